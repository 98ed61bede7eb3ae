//! Which modality to trust where (method 15): what runs with a known path have shown of odometry, laser and landmarks in
//! every part of a map, and what follows from it for a fix or a motion there.
//!
//! In: evidence of runs by cell (a square metre and one of four headings), areas that somebody named, the mode. Out: advice
//! for a pose: the best module, which are used, by how much each is biased and how much less sure it is than it claims.
//! Where a cell was hardly driven through, those around speak for it, then the named area it lies in, then the whole map.

mod evidence;
mod learn;
mod reference;

pub use evidence::{Evidence, Figures};
pub use learn::{Learnt, Run, learn};
pub use reference::{MAX_REFERENCE, Reference, ReferenceError};

use crate::{
    check::{self, MAX_COORDINATE_M, OutOfRange},
    localise::Modality,
    pose2::Pose2,
};
use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};
use std::{collections::BTreeMap, f64::consts::FRAC_PI_2};

/// Side of a cell.
pub const CELL_M: f64 = 1.0;
/// Measurements below which a place says nothing for itself: its parent speaks.
pub const MIN_MEASUREMENTS: u64 = 30;
/// Visits below which a bias may be chance, however many measurements they gave: those of one visit err together.
pub const MIN_VISITS: u64 = 3;
/// A module belongs to the fused set if its score is at most this many times the best one's.
const FUSED_SCORE: f64 = 2.0;
/// Most areas with a name.
pub const MAX_AREAS: usize = 64;
/// Most corners of one.
pub const MAX_CORNERS: usize = 64;
/// Longest name of an area, bytes.
pub const MAX_NAME_BYTES: usize = 64;
/// Most cells that one run may tell of.
pub const MAX_CELLS: usize = 4096;

/// What computes a position by itself ("localisation module" in the paper).
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Module {
    /// Odometry alone.
    Odometry,
    /// Scans and odometry.
    Laser,
    /// Recognised landmarks and odometry.
    Landmarks,
}

impl Module {
    /// All of them, in the order of every array here.
    pub const ALL: [Self; 3] = [Self::Odometry, Self::Laser, Self::Landmarks];

    fn index(self) -> usize {
        self as usize
    }
}

impl From<Modality> for Module {
    fn from(modality: Modality) -> Self {
        match modality {
            Modality::Laser => Self::Laser,
            Modality::Landmarks => Self::Landmarks,
        }
    }
}

/// What is fused where runs have told which module is best. Odometry carries the pose in any case.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Mode {
    /// Everything, each as sure as it proved to be.
    // Departs from method 15, which has the other two: see docs/EVALUATION.md, "Modalities by area".
    #[default]
    All,
    /// The modules whose score is at most twice the best one's.
    Fuse,
    /// The best module alone.
    Single,
}

/// A square metre of the floor, driven through in one of four headings.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(into = "[i64; 3]", try_from = "[i64; 3]")]
pub struct Cell {
    /// Metres from the origin, rounded down.
    pub x: i32,
    /// The same.
    pub y: i32,
    /// Quarter of the circle about 0, 90, 180, 270 degrees: 0 to 3.
    pub heading: u8,
}

impl Cell {
    /// Where a pose belongs.
    pub fn of(pose: &Pose2) -> Self {
        let square = |v: f64| (v / CELL_M).floor() as i32;
        let quarter = (pose.theta_rad / FRAC_PI_2).round().rem_euclid(4.0);
        Self { x: square(pose.x_m), y: square(pose.y_m), heading: quarter as u8 % 4 }
    }

    /// Its middle.
    pub fn middle_m(&self) -> [f64; 2] {
        [(f64::from(self.x) + 0.5) * CELL_M, (f64::from(self.y) + 0.5) * CELL_M]
    }
}

impl From<Cell> for [i64; 3] {
    fn from(cell: Cell) -> Self {
        [cell.x.into(), cell.y.into(), cell.heading.into()]
    }
}

impl TryFrom<[i64; 3]> for Cell {
    type Error = OutOfRange;

    fn try_from([x, y, heading]: [i64; 3]) -> Result<Self, OutOfRange> {
        let most = (MAX_COORDINATE_M / CELL_M) as i64;
        let coordinate = |field, v: i64| {
            let inside = (-most..=most).contains(&v);
            i32::try_from(v).ok().filter(|_| inside).ok_or(OutOfRange { field, value: v as f64 })
        };
        check::within("cell.heading", heading as f64, 0.0, 3.0)?;
        Ok(Self { x: coordinate("cell.x", x)?, y: coordinate("cell.y", y)?, heading: heading as u8 })
    }
}

/// Evidence of every module, in the order of [`Module::ALL`].
pub type Modules = [Evidence; 3];

/// A part of the map that somebody named: a room, a piece of corridor.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NamedArea {
    /// Its name.
    pub name: String,
    /// Its corners in order, x and y in metres; at least three. Where areas overlap the first one speaks.
    pub corners_m: Vec<[f64; 2]>,
}

impl NamedArea {
    /// A name, three corners or more, all in range.
    pub fn check(&self) -> Result<(), OutOfRange> {
        check::within("name", self.name.len() as f64, 1.0, MAX_NAME_BYTES as f64)?;
        check::within("corners_m", self.corners_m.len() as f64, 3.0, MAX_CORNERS as f64)?;
        for value in self.corners_m.iter().flatten() {
            check::within("corners_m", *value, -MAX_COORDINATE_M, MAX_COORDINATE_M)?;
        }
        Ok(())
    }

    /// Whether a point lies in it (even-odd rule).
    pub fn contains(&self, [x, y]: [f64; 2]) -> bool {
        let n = self.corners_m.len();
        let crosses = |i: &usize| {
            let ([ax, ay], [bx, by]) = (self.corners_m[*i], self.corners_m[(i + 1) % n]);
            (ay > y) != (by > y) && x < ax + (y - ay) / (by - ay) * (bx - ax)
        };
        (0..n).filter(crosses).count() % 2 == 1
    }
}

/// How a module errs in a place, beyond what it says itself. Robot-aligned: along, across (left), heading.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Fault {
    /// To be subtracted: metres, metres, radians; of odometry for each metre.
    pub bias: Vector3<f64>,
    /// To be added to each variance, as a share of what is claimed.
    pub excess: Vector3<f64>,
}

/// Where advice comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Level {
    /// The cell itself was driven through often enough.
    Cell,
    /// It and the eight around it.
    Around,
    /// The named area it lies in.
    Area,
    /// All of the map.
    Map,
}

/// What is known of the modules where a robot is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Advice {
    /// The best module; none where too little is known.
    pub best: Option<Module>,
    /// Which are used, in the order of [`Module::ALL`].
    pub used: [bool; 3],
    /// How each errs.
    pub faults: [Fault; 3],
    /// Where the ranking comes from.
    pub level: Level,
}

impl Default for Advice {
    /// Nothing is known: everything is used as it says.
    fn default() -> Self {
        Self { best: None, used: [true; 3], faults: [Fault::default(); 3], level: Level::Map }
    }
}

impl Advice {
    /// Whether fixes of a modality are used.
    pub fn uses(&self, modality: Modality) -> bool {
        self.used[Module::from(modality).index()]
    }

    /// How a module errs.
    pub fn fault(&self, module: Module) -> &Fault {
        &self.faults[module.index()]
    }
}

/// All that runs have shown of a map.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Areas {
    mode: Mode,
    named: Vec<(NamedArea, [Pool; 4])>,
    cells: BTreeMap<Cell, (Modules, Advice)>,
    map: Pool,
    elsewhere: Advice,
}

/// Cells added up.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct Pool {
    found: Modules,
    /// How many.
    cells: u64,
}

impl Pool {
    fn add(&mut self, found: &Modules) {
        for (sum, more) in self.found.iter_mut().zip(found) {
            sum.add(more);
        }
        self.cells += 1;
    }
}

impl Areas {
    /// Adds runs up. Names past [`MAX_AREAS`] are left out.
    pub fn new<'a>(
        mode: Mode,
        named: Vec<NamedArea>,
        runs: impl IntoIterator<Item = &'a BTreeMap<Cell, Modules>>,
    ) -> Self {
        let mut cells: BTreeMap<Cell, Modules> = BTreeMap::new();
        for (cell, found) in runs.into_iter().flatten() {
            for (sum, more) in cells.entry(*cell).or_default().iter_mut().zip(found) {
                sum.add(more);
            }
        }
        let mut made = Self { mode, ..Self::default() };
        made.named = named.into_iter().take(MAX_AREAS).map(|area| (area, [Pool::default(); 4])).collect();
        for (cell, found) in &cells {
            made.map.add(found);
            if let Some((_, pools)) = made.named.iter_mut().find(|(area, _)| area.contains(cell.middle_m())) {
                pools[usize::from(cell.heading)].add(found);
            }
        }
        made.elsewhere = made.judge(&[(Level::Map, made.map)]);
        made.cells = cells.iter().map(|(cell, found)| (*cell, (*found, Advice::default()))).collect();
        let told: Vec<Advice> = cells.keys().map(|cell| made.judged(cell)).collect();
        for ((_, advice), told) in made.cells.values_mut().zip(told) {
            *advice = told;
        }
        made
    }

    /// What is fused.
    pub fn mode(&self) -> Mode {
        self.mode
    }

    /// What is known where a pose is.
    pub fn advice(&self, at: &Pose2) -> Advice {
        if self.cells.is_empty() {
            return self.elsewhere;
        }
        let cell = Cell::of(at);
        self.cells.get(&cell).map_or_else(|| self.judged(&cell), |(_, advice)| *advice)
    }

    /// Every cell that was driven through, with what was found and what follows.
    pub fn cells(&self) -> impl Iterator<Item = (&Cell, &Modules, &Advice)> {
        self.cells.iter().map(|(cell, (found, advice))| (cell, found, advice))
    }

    /// Every named area with what was found in it, by heading, and what follows where its cells say nothing themselves.
    pub fn named(&self) -> impl Iterator<Item = (&NamedArea, [(Modules, Advice); 4])> {
        self.named.iter().map(|(area, by_heading)| {
            let told =
                |pool: &Pool| (pool.found, self.judge(&[(Level::Area, *pool), (Level::Map, self.map)]));
            (area, std::array::from_fn(|k| told(&by_heading[k])))
        })
    }

    /// All of the map together.
    pub fn map(&self) -> (&Modules, &Advice) {
        (&self.map.found, &self.elsewhere)
    }

    /// Advice for a cell.
    fn judged(&self, cell: &Cell) -> Advice {
        let (mut alone, mut around) = (Pool::default(), Pool::default());
        for (dx, dy) in (-1..=1).flat_map(|dx| (-1..=1).map(move |dy| (dx, dy))) {
            let near = Cell { x: cell.x.saturating_add(dx), y: cell.y.saturating_add(dy), ..*cell };
            let Some((found, _)) = self.cells.get(&near) else { continue };
            around.add(found);
            if near == *cell {
                alone.add(found);
            }
        }
        let mut levels = vec![(Level::Cell, alone), (Level::Around, around)];
        let named = self.named.iter().find(|(area, _)| area.contains(cell.middle_m()));
        levels.extend(named.map(|(_, by_heading)| (Level::Area, by_heading[usize::from(cell.heading)])));
        levels.push((Level::Map, self.map));
        self.judge(&levels)
    }

    /// Advice from the first of the levels that know enough.
    fn judge(&self, levels: &[(Level, Pool)]) -> Advice {
        let mut advice = Advice::default();
        for module in Module::ALL {
            let enough = |(_, pool): &&(Level, Pool)| pool.found[module.index()].fixes() >= MIN_MEASUREMENTS;
            if let Some((level, pool)) = levels.iter().find(enough) {
                // Robot-aligned biases of different places are different things: over the whole map they only tell how much
                // less sure a module is than it says.
                let cells = if *level == Level::Map { None } else { Some(pool.cells) };
                advice.faults[module.index()] = pool.found[module.index()].fault(cells);
            }
        }
        // Nobody is shut out of a place for what happened elsewhere.
        // Departs from method 15, where cells inherit all from their parents.
        let ranked = levels
            .iter()
            .filter(|(level, _)| *level != Level::Map)
            .find(|(_, pool)| pool.found[Module::Odometry.index()].available() >= MIN_MEASUREMENTS);
        let Some((level, pool)) = ranked else { return advice };
        let scores = pool.found.map(|evidence| evidence.score());
        let best = Module::ALL.into_iter().min_by(|a, b| scores[a.index()].total_cmp(&scores[b.index()]));
        let Some(best) = best else { return advice };
        let lowest = scores[best.index()];
        advice.used = match self.mode {
            Mode::All => [true; 3],
            Mode::Fuse => scores.map(|score| score <= FUSED_SCORE * lowest),
            Mode::Single => Module::ALL.map(|module| module == best),
        };
        (advice.best, advice.level) = (Some(best), *level);
        advice
    }
}

/// The turn that takes robot-aligned (along, across, heading) to (x, y, theta) of the map.
pub(crate) fn map_from_aligned(theta_rad: f64) -> Matrix3<f64> {
    let (s, c) = theta_rad.sin_cos();
    Matrix3::new(c, -s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0)
}

#[cfg(test)]
mod tests;
