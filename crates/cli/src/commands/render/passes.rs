//! Rendering in passes that double, while a second thread keeps what is done.

use std::{
    path::{Path, PathBuf},
    sync::{
        Condvar, Mutex, PoisonError,
        atomic::{AtomicBool, AtomicU64, Ordering},
    },
    thread,
    time::{Duration, Instant},
};

use anyhow::anyhow;
use vdf_image::{Image, shown};
use vdf_render::{Film, FilmPart, LiveFilm, NoiseLimit, PreparedScene, Progress, RenderError, RenderOptions};

use super::display::Display;
use crate::{
    failure::{Failure, say},
    progress::Reporter,
};

/// How often the second thread looks whether there is something to do.
const LOOK_EVERY: Duration = Duration::from_millis(50);

/// A part of a render, and when to stop.
pub(super) struct Plan<'a> {
    pub(super) prepared: &'a PreparedScene,
    pub(super) options: &'a RenderOptions,
    pub(super) part: FilmPart,
    pub(super) time_limit: Option<Duration>,
    pub(super) threads: usize,
    pub(super) machine: String,
    /// Who sees the picture after each pass.
    pub(super) display: Option<Display>,
}

/// Where what is done is kept.
pub(super) struct Checkpoint {
    pub(super) path: PathBuf,
    pub(super) every: Duration,
    /// Whether the file there is this render's: the one that it goes on from, or one that it has written.
    pub(super) ours: AtomicBool,
}

impl Checkpoint {
    /// Writes it; another file that has appeared there since is not replaced.
    fn write(&self, film: &Film) -> Result<(), Failure> {
        let path = &self.path;
        if !self.ours.load(Ordering::Relaxed) && path.exists() {
            return Err(Failure::Work(anyhow!(
                "--checkpoint {}: another program has written such a file by now; it is left as it is",
                shown(path)
            )));
        }
        film.write(path).map_err(|e| Failure::Work(e.into()))?;
        self.ours.store(true, Ordering::Relaxed);
        Ok(())
    }
}

/// What has been rendered: a film whose tiles all have the samples of the part up to `end`, but for those that are quiet.
pub(super) struct Rendered {
    pub(super) film: Film,
    pub(super) end: u32,
}

/// What the two threads tell each other.
struct Shared<'a> {
    reporter: &'a Reporter,
    film: &'a LiveFilm,
    /// The time is up.
    late: AtomicBool,
    /// Why the second thread wants to stop.
    failure: Mutex<Option<Failure>>,
    failed: AtomicBool,
    done: Mutex<bool>,
    wake: Condvar,
    paths: AtomicU64,
}

impl Progress for Shared<'_> {
    fn phase(&self, name: &str) {
        self.reporter.phase(name);
    }

    fn work_total(&self, n: u64) {
        self.reporter.work_total(n);
    }

    fn work_done(&self, n: u64) {
        self.paths.fetch_add(n, Ordering::Relaxed);
        self.reporter.work_done(n);
    }

    fn cancelled(&self) -> bool {
        self.reporter.cancelled() || self.late.load(Ordering::Relaxed) || self.failed.load(Ordering::Relaxed)
    }
}

/// Renders until the part is complete or the time is up. `picture` writes the picture so far when the user asks for it by a signal.
///
/// If the work is interrupted or fails, the checkpoint has what was done.
pub(super) fn render(
    plan: &Plan<'_>,
    film: Film,
    checkpoint: Option<&Checkpoint>,
    reporter: &Reporter,
    asked: &AtomicBool,
    picture: &(dyn Fn(&Film) -> Result<(), Failure> + Sync),
) -> Result<Rendered, Failure> {
    let film = LiveFilm::new(film);
    let shared = Shared {
        reporter,
        film: &film,
        late: AtomicBool::new(false),
        failure: Mutex::new(None),
        failed: AtomicBool::new(false),
        done: Mutex::new(false),
        wake: Condvar::new(),
        paths: AtomicU64::new(0),
    };
    let clock = Clock::start(plan, film.snapshot().runs().len());
    reporter.phase("rendering");
    tell_total(plan, &film.snapshot(), reporter);
    let outcome = thread::scope(|scope| {
        let keeper = scope.spawn(|| keep(&shared, &clock, checkpoint, asked, picture));
        let outcome = passes(plan, &shared, &clock);
        *shared.done.lock().unwrap_or_else(PoisonError::into_inner) = true;
        shared.wake.notify_all();
        // It does not panic; if it did, there is nothing to add to the message.
        drop(keeper.join());
        outcome
    });
    reporter.finish();
    let failure = shared.failure.lock().unwrap_or_else(PoisonError::into_inner).take();
    if let Some(failure) = failure {
        return Err(failure);
    }
    clock.note(&film, &shared.paths);
    match (outcome, checkpoint) {
        (Ok(mut rendered), checkpoint) => {
            if let Some(checkpoint) = checkpoint
                && let Err(failure) = checkpoint.write(&film.snapshot())
            {
                // The result is worth more than what it was made of.
                say(format_args!("warning: the last checkpoint: {}", failure.message()));
            }
            let run = film.snapshot().runs().last().cloned();
            rendered.film.set_run(clock.number, run.unwrap_or_default());
            Ok(rendered)
        }
        (Err(Failure::Interrupted), Some(checkpoint)) => {
            let film = film.snapshot();
            checkpoint.write(&film)?;
            let (done, path) = (film.total_samples(), shown(&checkpoint.path));
            Err(Failure::Stopped(format!("interrupted; {done} samples are kept in {path}; go on with --resume")))
        }
        (Err(failure), _) => Err(failure),
    }
}

/// How much there is to do as far as that is known, and how much is done.
fn tell_total(plan: &Plan<'_>, film: &Film, reporter: &Reporter) {
    match plan.time_limit {
        Some(limit) => reporter.limit(limit),
        None => {
            let missing: u64 = film.missing_samples(&plan.part);
            reporter.work_total(missing + film.total_samples());
            reporter.work_before(film.total_samples());
        }
    }
}

/// The time of this run.
struct Clock<'a> {
    plan: &'a Plan<'a>,
    start: Instant,
    /// This run is the film's run of this number.
    number: usize,
}

impl<'a> Clock<'a> {
    fn start(plan: &'a Plan<'a>, number: usize) -> Self {
        Self { plan, start: Instant::now(), number }
    }

    /// Lets the film remember this run as it is now.
    fn note(&self, film: &LiveFilm, paths: &AtomicU64) {
        let Plan { prepared, threads, machine, .. } = self.plan;
        let seconds = self.start.elapsed().as_secs_f64();
        let run = prepared.run(machine, *threads, paths.load(Ordering::Relaxed), seconds);
        film.update(|film| film.set_run(self.number, run));
    }
}

/// Passes that double the samples, until the part is complete, all tiles are quiet, or the next pass would take too long.
fn passes(plan: &Plan<'_>, shared: &Shared<'_>, clock: &Clock<'_>) -> Result<Rendered, Failure> {
    let Plan { prepared, options, part, .. } = plan;
    let (first, goal) = (part.samples.start, part.samples.end);
    let mut whole = shared.film.snapshot();
    let mut end = whole.complete_until(part);
    let (began_at, mut picture) = (end, None);
    // In a film that is gone on with, some tiles may be ahead: the others have to follow before there is a picture.
    let ahead = u32::try_from(whole.samples_end()).unwrap_or(goal).min(goal);
    while end < goal && whole.missing_samples(part) > 0 {
        if options.noise.is_some() && end > first {
            tell_total(plan, &whole, shared.reporter);
        }
        let done = end - first;
        let mut size = done.max(1).max(ahead.saturating_sub(end)).min(goal - end);
        if let (Some(limit), true) = (plan.time_limit, end > began_at && end >= ahead) {
            let elapsed = clock.start.elapsed().as_secs_f64();
            let each = elapsed / f64::from(end - began_at);
            // A pass that does not end in time is lost, so it shall not be planned too tightly.
            let fit = 0.95 * (limit.as_secs_f64() - elapsed) / each;
            if fit < 1.0 {
                break;
            }
            size = size.min(fit as u32);
        }
        let pass = FilmPart { samples: first..end + size, ..part.clone() };
        match prepared.render_part(options, shared.film, &pass, shared) {
            Ok(()) => {}
            Err(RenderError::Cancelled) if shared.late.load(Ordering::Relaxed) && !shared.reporter.cancelled() => {
                if done > 0 && end >= ahead {
                    break;
                }
                // One sample there must be, and as many everywhere.
                prepared.render_part(options, shared.film, &pass, shared.reporter)?;
            }
            Err(error) => return Err(error.into()),
        }
        end += size;
        // Tiles of the next pass will be ahead of the others, and cannot be taken back.
        whole = shared.film.snapshot();
        picture = tell_error(shared, &whole, picture, f64::from(done), f64::from(size), end - first);
        if let (Some(display), Some(picture)) = (&plan.display, &picture) {
            display.show(picture);
        }
    }
    Ok(Rendered { film: whole, end })
}

/// Tells how many samples there are, and what error the image has. Where no variances are kept it is judged by what the last pass changed: if a is
/// the mean of the first n samples and c that of all n + m, the variance of c is n/m times the expectation of (a − c)².
fn tell_error(shared: &Shared<'_>, film: &Film, before: Option<Image>, n: f64, m: f64, spp: u32) -> Option<Image> {
    let after = film.develop_so_far().ok()?;
    let by_change = |before: Image| {
        let square = |p: vdf_image::Rgb| p.as_dvec3().length_squared();
        let changes: f64 = before.pixels.iter().zip(&after.pixels).map(|(a, c)| square(*a - *c)).sum();
        let sum: f64 = after.pixels.iter().map(|p| f64::from(p.element_sum())).sum();
        let numbers = 3.0 * after.pixels.len() as f64;
        (sum > 0.0).then(|| (changes * n / m / numbers).sqrt() / (sum / numbers))
    };
    let error = film.noise().or_else(|| before.filter(|_| n > 0.0).and_then(by_change));
    shared.reporter.pass(spp, error);
    Some(after)
}

/// The second thread: writes checkpoints and the picture so far, and looks at the clock.
fn keep(
    shared: &Shared<'_>,
    clock: &Clock<'_>,
    checkpoint: Option<&Checkpoint>,
    asked: &AtomicBool,
    picture: &(dyn Fn(&Film) -> Result<(), Failure> + Sync),
) {
    let mut written = Instant::now();
    loop {
        let done = shared.done.lock().unwrap_or_else(PoisonError::into_inner);
        let (done, _) = shared.wake.wait_timeout(done, LOOK_EVERY).unwrap_or_else(PoisonError::into_inner);
        if *done {
            return;
        }
        drop(done);
        if clock.plan.time_limit.is_some_and(|limit| clock.start.elapsed() >= limit) {
            shared.late.store(true, Ordering::Relaxed);
        }
        if asked.swap(false, Ordering::Relaxed)
            && let Err(failure) = picture(&shared.film.snapshot())
        {
            // The render is worth more than a look at it.
            say(format_args!("warning: the picture so far: {}", failure.message()));
        }
        if let Some(checkpoint) = checkpoint
            && written.elapsed() >= checkpoint.every
        {
            clock.note(shared.film, &shared.paths);
            if let Err(failure) = checkpoint.write(&shared.film.snapshot()) {
                *shared.failure.lock().unwrap_or_else(PoisonError::into_inner) = Some(failure);
                shared.failed.store(true, Ordering::Relaxed);
                return;
            }
            written = Instant::now();
        }
    }
}

/// The film to begin with: that of the checkpoint, if there is one and it is to be gone on with.
pub(super) fn begin(empty: Film, checkpoint: Option<(&Path, bool)>) -> Result<Film, Failure> {
    let Some((path, resume)) = checkpoint.filter(|(path, _)| path.exists()) else { return Ok(empty) };
    let name = shown(path);
    if !resume {
        return Err(Failure::Usage(anyhow!(
            "--checkpoint {name}: there is such a file; go on from it with --resume, or give another name"
        )));
    }
    let film = Film::read(path).map_err(|e| Failure::Work(e.into()))?;
    empty
        .origin()
        .check_same_samples(film.origin())
        .map_err(|e| Failure::Usage(anyhow!("--resume: {name} is of another render: {e}")))?;
    let (have, spp) = (film.samples_end(), empty.origin().spp);
    if have > u64::from(spp) {
        return Err(Failure::Usage(anyhow!(
            "--resume: {name} has samples up to {have}, which cannot be taken back to {spp}; give --spp {have} or more"
        )));
    }
    match (film.origin().noise, empty.origin().noise) {
        (None, None) => Ok(film.of_spp(spp)),
        // Whatever went on at the one limit went on at the other.
        (Some(had), Some(limit)) if limit <= had => Ok(film.of_spp(spp).of_noise(limit)),
        (had, limit) => {
            let told = |l: Option<NoiseLimit>| l.map_or_else(|| "none".to_owned(), |l| f64::from(l).to_string());
            Err(Failure::Usage(anyhow!(
                "--resume: {name} was rendered with --noise {}, and can be gone on with only with the same or a lower one, not {}",
                told(had),
                told(limit)
            )))
        }
    }
}
