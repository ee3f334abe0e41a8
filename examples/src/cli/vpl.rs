//! `fogbow render --method vpl`.

use core::num::NonZero;
use core::str::FromStr;

use clap::{Arg, Args, ValueEnum};
use fogbow::host::Medium;
use fogbow::math::{Ray, Vec2};
use fogbow::medium::Pyramid;
use fogbow::sampling::{Generator, uniform2};
use fogbow::spectrum::Spectrum;
use fogbow::vpl::{self, Bound, Compensation, EyeSettings, LEVELS, MOST_CANDIDATES, Settings, VplRadiance};
use fogbow::world::{Outline, World as LitWorld};
use fogbow_std::film::Film;
use fogbow_std::progress::Control;
use fogbow_std::progressive;
use fogbow_std::seed::Sequence;
use fogbow_std::stats::{CountingMedium, CountingScene};
use fogbow_std::tiles::{Outcome, Passes};

use super::Failure;
use super::defaults::{unit_outline, with_default};
use super::render::{LAYERS, Shot, weigh, write_layers};
use crate::world::WithMedium;

/// Options of `--method vpl`.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Virtual lights", mut_args(told))]
pub struct VplArguments {
    /// Virtual lights of each pass.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1 << 24))]
    pub lights: Option<u32>,
    /// How many times as many are made; those are kept that matter most for the picture. 1 keeps all.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=256))]
    pub candidates: Option<u32>,
    /// Bound of geometry terms, by which near virtual lights are clamped, in the scene's unit of length to the power of
    /// -2; `auto` finds one that two steps of compensation nearly bring back, `off` leaves bright splotches.
    #[arg(long, value_name = "auto|off|VALUE", default_value = "auto", allow_hyphen_values = true)]
    pub clamp: Clamp,
    /// How what clamping takes away is brought back.
    #[arg(long, value_enum, default_value_t = Recovery::Abc)]
    pub compensation: Recovery,
    /// Steps of compensation.
    #[arg(long, value_name = "K", value_parser = clap::value_parser!(u32).range(1..))]
    pub steps: Option<u32>,
    /// Whether compensation asks what lies between a point of the medium and the next.
    #[arg(long, value_enum, value_name = "on|off")]
    pub local_visibility: Option<Switch>,
    /// Lights that share a point on the eye ray and a compensation path, with 1-to-1 and abc: more cost less, and are
    /// noisier together.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1 << 24))]
    pub share: Option<u32>,
    /// Points on each eye ray at which each light is gathered.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=4096))]
    pub light_points: Option<u32>,
}

/// An option with the default of [`Settings::for_outline`].
fn told(option: Arg) -> Arg {
    const ABC: Compensation = Compensation::APPROXIMATE;
    let usual = Settings::for_outline(&unit_outline());
    match option.get_id().as_str() {
        "lights" => with_default(option, usual.lights),
        "candidates" => with_default(
            option,
            format!("{}; at most {MOST_CANDIDATES} in all, or as many as lights", usual.candidates),
        ),
        "steps" => with_default(option, ABC.steps),
        "local_visibility" => with_default(option, if ABC.local_visibility { "on" } else { "off" }),
        "share" => {
            let [one_to_one, abc] = [Compensation::ONE_TO_ONE, ABC].map(|of| of.lights_per_point);
            with_default(option, format!("{one_to_one}, for abc {abc}"))
        }
        "light_points" => with_default(option, usual.points),
        _ => option,
    }
}

/// How what clamping takes away is brought back.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Recovery {
    /// It stays lost.
    None,
    /// All of it, without bias: the reference; one path for all lights.
    Full,
    /// A path for each light, from one point on the eye ray.
    #[value(name = "n-to-1")]
    NToOne,
    /// A point and a path for each light.
    #[value(name = "1-to-1")]
    OneToOne,
    /// The same for groups of lights, in media taken as even around each point: approximate bias compensation.
    Abc,
}

/// On or off.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Switch {
    /// On.
    On,
    /// Off.
    Off,
}

/// A bound, or how to find one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Clamp {
    /// [`vpl::usual_bound`].
    Auto,
    /// This one.
    To(Bound),
}

impl FromStr for Clamp {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "auto" => Ok(Self::Auto),
            "off" => Ok(Self::To(Bound::NONE)),
            _ => match text.parse::<f32>().map(Bound::new) {
                Ok(Ok(bound)) if bound != Bound::NONE => Ok(Self::To(bound)),
                _ => Err("must be a positive finite number, `auto` or `off`".to_owned()),
            },
        }
    }
}

impl VplArguments {
    /// Options that would do nothing are mistakes.
    pub(super) fn check(&self) -> Result<(), Failure> {
        let is_clamped = self.clamp != Clamp::To(Bound::NONE);
        match self.compensation {
            Recovery::None if self.steps.is_some() || self.local_visibility.is_some() => {
                Err("--steps and --local-visibility need --compensation other than none".into())
            }
            Recovery::Full if self.steps.is_some() || self.local_visibility.is_some() => Err(
                "--compensation full takes as many steps as there are, and asks for visibility: leave out --steps and --local-visibility"
                    .into(),
            ),
            Recovery::None | Recovery::Full | Recovery::NToOne if self.share.is_some() => {
                Err("--share needs --compensation 1-to-1 or abc".into())
            }
            _ if !is_clamped && (self.steps.is_some() || self.local_visibility.is_some()) => {
                Err("--clamp off leaves nothing to compensate: leave out --steps and --local-visibility".into())
            }
            _ => Ok(()),
        }
    }
    fn compensation(&self) -> Option<Compensation> {
        let base = match self.compensation {
            Recovery::None => return None,
            Recovery::Full => return Some(Compensation::FULL),
            Recovery::NToOne => Compensation::N_TO_ONE,
            Recovery::OneToOne => Compensation::ONE_TO_ONE,
            Recovery::Abc => Compensation::APPROXIMATE,
        };
        let local_visibility = self.local_visibility.map_or(base.local_visibility, |switch| switch == Switch::On);
        let base = match self.share {
            Some(n) => Compensation { lights_per_point: n, lights_per_path: n, ..base },
            None => base,
        };
        Some(Compensation { steps: self.steps.unwrap_or(base.steps), local_visibility, ..base })
    }

    fn settings(&self, outline: &Outline, pass_samples: Option<NonZero<u32>>, shot: &Shot<'_>) -> Settings {
        let usual = Settings::for_outline(outline);
        Settings {
            walk: shot.paths,
            lights: self.lights.unwrap_or(usual.lights),
            candidates: self.candidates.unwrap_or(usual.candidates),
            samples: pass_samples.map_or(usual.samples, NonZero::get),
            bound: match self.clamp {
                Clamp::Auto => usual.bound,
                Clamp::To(bound) => bound,
            },
            compensation: self.compensation(),
            points: self.light_points.unwrap_or(usual.points),
            seed: shot.settings.seed,
            ..usual
        }
    }
}

/// Layers that virtual lights add: their clamped light, what each step of compensation adds to that, and of it the part
/// that comes straight from the lights.
pub(super) const OWN: [&str; 2 + LEVELS] =
    ["clamped", "compensated_1", "compensated_2", "compensated_3", "compensated_rest", "compensated_straight"];

/// A render by virtual lights, to be done with a medium of any type.
pub(super) struct VplJob<'a> {
    pub(super) shot: Shot<'a>,
    pub(super) control: &'a Control<'a>,
    pub(super) film: &'a mut Film,
    pub(super) arguments: &'a VplArguments,
    pub(super) pass_samples: Option<NonZero<u32>>,
}

impl WithMedium for VplJob<'_> {
    type Output = Result<(Outcome, Settings), Failure>;

    fn with<M: Medium + Sync>(self, medium: &M) -> Self::Output {
        let shot = self.shot;
        let (width, height) = (self.film.width(), self.film.height());
        let world = LitWorld { medium, scene: shot.world, lights: shot.lights };
        let usual = self.arguments.settings(&shot.world.outline(&world), self.pass_samples, &shot);
        let (bounds, size) = usual.pyramid();
        let mut means = vec![Spectrum::ZERO; Pyramid::<()>::cell_count(size)];
        let medium = Pyramid::new(medium, bounds, size, &mut means)
            .map_err(|error| format!("virtual lights cannot average the medium's extinction: {error}"))?;
        let world = LitWorld { medium: &medium, scene: shot.world, lights: shot.lights };
        let mut witnesses = Vec::new();
        let eye = |at, rng: &mut Generator| scout(&shot, at, (width, height), rng);
        vpl::witnesses(&world, &usual, eye, |witness| witnesses.push(witness));
        let length = NonZero::new(usual.samples).unwrap_or(NonZero::<u32>::MIN);
        let mut piloted = None;
        let outcome = progressive::render(
            self.film,
            shot.settings,
            self.control,
            Passes { length, may_break: true },
            |pass, runner| {
                let settings = *piloted.get_or_insert_with(|| {
                    let mut pilot = vpl::VplPass::pilot(&usual, Sequence::LowDiscrepancy);
                    runner.run(&mut pilot, &world);
                    pilot.settings_for_lights()
                });
                let mut pass = vpl::VplPass::new(&settings, pass, Sequence::LowDiscrepancy, &witnesses);
                runner.run(&mut pass, &world);
                pass.finish()
            },
            |lights, sample, rng, layers| {
                let world = LitWorld {
                    medium: &CountingMedium { medium: &medium, tally: sample.tally },
                    scene: &CountingScene { scene: shot.world, tally: sample.tally },
                    lights: shot.lights,
                };
                let (ray, weight) = shot.eye_ray(sample, (width, height), rng);
                let eye = EyeSettings { sees_medium: shot.is_computed(sample, width), ..usual.eye() };
                let (part, share) = usual.part(lights.as_slice(), sample.index);
                let seen = vpl::radiance(&ray, &usual.gatherer(&world), part, share, &eye, rng);
                sample.tally.collide(seen.radiance.collisions);
                write(&seen, layers);
                weigh(layers, weight);
            },
        )?;
        Ok((outcome, usual))
    }
}

/// An eye ray somewhere in the pixel of a point of the film.
fn scout(shot: &Shot<'_>, at: [f32; 2], (width, height): (u32, u32), rng: &mut Generator) -> Ray {
    let [x, y] = [(at[0], width), (at[1], height)].map(|(at, side)| (f64::from(at) * f64::from(side)).floor() as f32);
    let at = Vec2::new(x, y) + uniform2(rng);
    shot.camera.ray(at / Vec2::new(width as f32, height as f32))
}

fn write(seen: &VplRadiance, layers: &mut [Spectrum]) {
    write_layers(&seen.radiance, layers);
    let own = core::iter::once(seen.clamped).chain(seen.compensated).chain([seen.straight]);
    for (layer, part) in layers.iter_mut().skip(LAYERS.len()).zip(own) {
        *layer = part;
    }
}

/// What became of the light that virtual lights send to the picture: means over its pixels and channels (W·m⁻²·sr⁻¹).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Audit {
    /// By which connections were clamped (m⁻²).
    pub(crate) bound: f32,
    /// What clamping leaves.
    pub(crate) clamped: f64,
    /// What steps of compensation brought back.
    pub(crate) recovered: [f64; LEVELS],
    /// What further steps would, if each went on to bring back as much of the one before as the last did; 0 after more steps
    /// than are told apart, `None` where there are not two to compare.
    pub(crate) left: Option<f64>,
}

impl Audit {
    /// Of a film with layers [`OWN`].
    pub(super) fn new(film: &Film, bound: Bound, arguments: &VplArguments) -> Self {
        let mean = |name: &str| {
            let image = film.layers().iter().position(|layer| layer == name).and_then(|i| film.mean(i));
            image.map_or(0.0, |image| {
                let sum: f64 = image.pixels.iter().map(|pixel| f64::from(pixel.mean())).sum();
                sum / (image.pixels.len().max(1) as f64)
            })
        };
        let [clamped, recovered @ .., _] = OWN.map(mean);
        let left = match arguments.compensation().map(|c| c.steps as usize) {
            None => None,
            Some(steps) if steps > LEVELS => Some(0.0),
            Some(1) => None,
            Some(steps) => {
                let (before, last) = (recovered[steps - 2], recovered[steps - 1]);
                let ratio = if before > 0.0 { last / before } else { 0.0 };
                (ratio < 1.0).then(|| last * ratio / (1.0 - ratio))
            }
        };
        Self { bound: bound.value(), clamped, recovered, left }
    }
}
