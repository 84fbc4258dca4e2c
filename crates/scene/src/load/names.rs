//! Hints for names: spelling, the old format's names, and options that belong on the command line.

use std::fmt::Write as _;

/// Names of Mitsuba 0.6 that are no mere change from camelCase, with what to write now.
const OLD_NAMES: [(&str, &str); 6] = [
    ("sigmaS", "write sigma_t (extinction) and albedo (sigma_s / sigma_t)"),
    ("sigma_s", "write sigma_t (extinction) and albedo (sigma_s / sigma_t)"),
    ("sigmaA", "write sigma_t = sigma_s + sigma_a, and albedo = sigma_s / sigma_t"),
    ("sigma_a", "write sigma_t = sigma_s + sigma_a, and albedo = sigma_s / sigma_t"),
    ("density", "write sigma_t and albedo, and \"scale\" for a common factor of sigma_t"),
    ("lookAt", "write lookat"),
];

/// What `vdf` takes on the command line only.
const COMMAND_LINE: [(&str, &str); 8] = [
    ("method", "--method"),
    ("voxel", "--voxel"),
    ("voxel_size", "--voxel"),
    ("samples_per_segment", "--samples-per-segment"),
    ("threads", "-j"),
    ("crop", "--crop (or crop_offset_x, crop_offset_y, crop_width and crop_height of the film)"),
    ("spp", "--spp (or sample_count of the sampler)"),
    ("stats", "--stats"),
];

/// What to do about a name that would be an error whatever the element is.
pub(super) fn foreign_name(name: &str) -> Option<(String, String)> {
    if let Some((_, help)) = OLD_NAMES.iter().find(|(old, _)| *old == name) {
        return Some((format!("\"{name}\" is a name of Mitsuba 0.6"), (*help).to_owned()));
    }
    if let Some((_, flag)) = COMMAND_LINE.iter().find(|(option, _)| *option == name) {
        return Some((
            format!("\"{name}\" is not a property of a scene file"),
            format!("this option of vdf is given on the command line: {flag}"),
        ));
    }
    let starts_lower = name.chars().next().is_some_and(|c| c.is_ascii_lowercase());
    if starts_lower && name.chars().any(|c| c.is_ascii_uppercase()) {
        let mut snake = String::new();
        for c in name.chars() {
            if c.is_ascii_uppercase() {
                snake.push('_');
            }
            snake.push(c.to_ascii_lowercase());
        }
        return Some((format!("\"{name}\" is spelled as in Mitsuba 0.6"), format!("write \"{snake}\"")));
    }
    None
}

/// "did you mean …? supported: …", for a name that is none of `known`.
pub(super) fn suggest(name: &str, known: &[&str]) -> String {
    let mut help = String::new();
    let nearest = known.iter().min_by_key(|k| strsim::damerau_levenshtein(name, k));
    if let Some(nearest) = nearest.filter(|n| strsim::damerau_levenshtein(name, n) <= 1 + n.len() / 4) {
        let _ = write!(help, "did you mean \"{nearest}\"? ");
    }
    if known.is_empty() {
        help.push_str("there is none here");
    } else {
        let _ = write!(help, "supported: {}", known.join(", "));
    }
    help
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn old_and_foreign_names_have_their_own_hint() {
        assert!(foreign_name("sigmaS").is_some_and(|(_, help)| help.contains("albedo")));
        assert!(foreign_name("toWorld").is_some_and(|(_, help)| help.contains("\"to_world\"")));
        assert!(foreign_name("method").is_some_and(|(_, help)| help.contains("--method")));
        assert_eq!(foreign_name("to_world"), None);
        assert_eq!(foreign_name("G"), None);
    }

    #[test]
    fn the_nearest_name_is_suggested_and_a_far_one_is_not() {
        assert!(suggest("heigth", &["width", "height"]).starts_with("did you mean \"height\"?"));
        assert_eq!(suggest("zzz", &["width", "height"]), "supported: width, height");
    }
}
