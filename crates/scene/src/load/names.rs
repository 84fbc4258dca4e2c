//! Hints for names: spelling, the old format's names, and options of the renderer.

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

/// Options of the renderer, which are no part of a scene.
const OPTIONS: [&str; 8] = ["method", "voxel", "voxel_size", "samples_per_segment", "threads", "crop", "spp", "stats"];

/// What to do about a name that would be an error whatever the element is.
pub(super) fn foreign_name(name: &str) -> Option<(String, String)> {
    if let Some((_, help)) = OLD_NAMES.iter().find(|(old, _)| *old == name) {
        return Some((format!("\"{name}\" is a name of Mitsuba 0.6"), (*help).to_owned()));
    }
    if OPTIONS.contains(&name) {
        let help = match name {
            "spp" => "write sample_count inside the <sampler>",
            "crop" => "write crop_offset_x, crop_offset_y, crop_width and crop_height inside the <film>",
            _ => "it is an option of the renderer: remove it here, and give it to the program",
        };
        return Some((format!("\"{name}\" is not a property of a scene file"), help.to_owned()));
    }
    let starts_lower = name.chars().next().is_some_and(|c| c.is_ascii_lowercase());
    if starts_lower && name.chars().any(|c| c.is_ascii_uppercase()) {
        return Some((format!("\"{name}\" is spelled as in Mitsuba 0.6"), format!("write \"{}\"", snake_case(name))));
    }
    None
}

/// `intIOR` as `int_ior`: the name of today for one of Mitsuba 0.6.
pub(super) fn snake_case(name: &str) -> String {
    let mut snake = String::with_capacity(name.len() + 4);
    let mut last = None;
    let mut in_capitals = false;
    for c in name.chars() {
        let begins = c.is_ascii_uppercase() && last.is_some_and(|l: char| l.is_ascii_lowercase());
        in_capitals = begins || (in_capitals && c.is_ascii_uppercase());
        if begins {
            snake.push('_');
        }
        snake.push(if in_capitals { c.to_ascii_lowercase() } else { c });
        last = Some(c);
    }
    snake
}

/// Longer names are not compared, and more names are not looked at: the cost of a comparison grows with the product of the lengths.
const MAX_COMPARED_LENGTH: usize = 64;
const MAX_COMPARED: usize = 10_000;
/// More names are not listed.
const MAX_LISTED: usize = 40;

/// "did you mean …? supported: …", for a name that is none of `known`.
pub(super) fn suggest(name: &str, known: &[&str]) -> String {
    suggest_of("supported", name, known)
}

/// "did you mean …? defined: …", for a name that the file or the caller gives.
pub(super) fn suggest_defined(name: &str, known: &[&str]) -> String {
    suggest_of("defined", name, known)
}

fn suggest_of(what: &str, name: &str, known: &[&str]) -> String {
    let mut help = String::new();
    let comparable = |name: &str| name.len() <= MAX_COMPARED_LENGTH;
    let nearest = known
        .iter()
        .take(MAX_COMPARED)
        .filter(|k| comparable(name) && comparable(k))
        .map(|k| (strsim::damerau_levenshtein(name, k), k))
        .min_by_key(|(distance, _)| *distance);
    if let Some((_, nearest)) = nearest.filter(|(distance, nearest)| *distance <= 1 + nearest.len() / 4) {
        let _ = write!(help, "did you mean \"{nearest}\"? ");
    }
    match known {
        [] => help.push_str("there is none here"),
        _ if known.len() <= MAX_LISTED => {
            let _ = write!(help, "{what}: {}", known.join(", "));
        }
        _ => {
            let _ = write!(help, "{what}: {}, and {} more", known[..MAX_LISTED].join(", "), known.len() - MAX_LISTED);
        }
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
        assert!(foreign_name("method").is_some_and(|(_, help)| help.contains("option of the renderer")));
        assert_eq!(foreign_name("to_world"), None);
        assert_eq!(foreign_name("G"), None);
        let upgraded = ["toWorld", "intIOR", "maxDepth", "B", "to_world"].map(snake_case);
        assert_eq!(upgraded, ["to_world", "int_ior", "max_depth", "B", "to_world"]);
    }

    #[test]
    fn the_nearest_name_is_suggested_and_a_far_one_is_not() {
        assert!(suggest("heigth", &["width", "height"]).starts_with("did you mean \"height\"?"));
        assert_eq!(suggest("zzz", &["width", "height"]), "supported: width, height");
    }
}
