//! The statistics of all runs of a map, added up by cell, named area and map.

use crate::{
    modality_stats::{
        advice::{ModalityAdvice, StatsScope},
        evidence::{MIN_MEASUREMENTS, StatsByModality},
        modality::{FusionMode, Modality},
        named_area::{MAX_AREAS, NamedArea},
    },
    pose_cell::PoseCell,
    pose2::Pose2,
};
use std::collections::BTreeMap;

/// [`FusionMode::Fuse`] uses a modality if its score is at most this many times the best one's.
const FUSED_SCORE: f64 = 2.0;

/// The statistics of all reference runs of a map.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ModalityMap {
    mode: FusionMode,
    named: Vec<(NamedArea, [Pool; 4])>,
    cells: BTreeMap<PoseCell, (StatsByModality, ModalityAdvice)>,
    map: Pool,
    elsewhere: ModalityAdvice,
}

/// The sum of several cells.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct Pool {
    found: StatsByModality,
    /// Number of cells added.
    cells: u64,
}

impl Pool {
    fn add(&mut self, found: &StatsByModality) {
        for (sum, more) in self.found.iter_mut().zip(found) {
            sum.add(more);
        }
        self.cells += 1;
    }
}

impl ModalityMap {
    /// Adds the statistics of runs. Named areas beyond [`MAX_AREAS`] are left out.
    pub fn new<'a>(
        mode: FusionMode,
        named: Vec<NamedArea>,
        runs: impl IntoIterator<Item = &'a BTreeMap<PoseCell, StatsByModality>>,
    ) -> Self {
        let mut cells: BTreeMap<PoseCell, StatsByModality> = BTreeMap::new();
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
        made.elsewhere = made.advice_from(&[(StatsScope::Map, made.map)]);
        made.cells = cells.iter().map(|(cell, found)| (*cell, (*found, ModalityAdvice::default()))).collect();
        let advice_of_cells: Vec<ModalityAdvice> =
            cells.keys().map(|cell| made.advice_of_cell(cell)).collect();
        for ((_, advice), advice_of_cells) in made.cells.values_mut().zip(advice_of_cells) {
            *advice = advice_of_cells;
        }
        made
    }

    /// The fusion mode.
    pub fn mode(&self) -> FusionMode {
        self.mode
    }

    /// The advice at a pose.
    pub fn advice(&self, at: &Pose2) -> ModalityAdvice {
        if self.cells.is_empty() {
            return self.elsewhere;
        }
        let cell = PoseCell::of(at);
        self.cells.get(&cell).map_or_else(|| self.advice_of_cell(&cell), |(_, advice)| *advice)
    }

    /// Every cell with measurements, its statistics, and the advice there.
    pub fn cells(&self) -> impl Iterator<Item = (&PoseCell, &StatsByModality, &ModalityAdvice)> {
        self.cells.iter().map(|(cell, (found, advice))| (cell, found, advice))
    }

    /// Every named area with its statistics and advice by heading; the advice holds where the cells
    /// have too few measurements.
    pub fn named(&self) -> impl Iterator<Item = (&NamedArea, [(StatsByModality, ModalityAdvice); 4])> {
        self.named.iter().map(|(area, by_heading)| {
            let advice_of_cells = |pool: &Pool| {
                (pool.found, self.advice_from(&[(StatsScope::Area, *pool), (StatsScope::Map, self.map)]))
            };
            (area, std::array::from_fn(|k| advice_of_cells(&by_heading[k])))
        })
    }

    /// Statistics and advice of the whole map.
    pub fn map(&self) -> (&StatsByModality, &ModalityAdvice) {
        (&self.map.found, &self.elsewhere)
    }

    /// Advice for a cell: from the cell, its neighbours, its named area or the map.
    fn advice_of_cell(&self, cell: &PoseCell) -> ModalityAdvice {
        let (mut alone, mut around) = (Pool::default(), Pool::default());
        for (dx, dy) in (-1..=1).flat_map(|dx| (-1..=1).map(move |dy| (dx, dy))) {
            let near = PoseCell { x: cell.x.saturating_add(dx), y: cell.y.saturating_add(dy), ..*cell };
            let Some((found, _)) = self.cells.get(&near) else { continue };
            around.add(found);
            if near == *cell {
                alone.add(found);
            }
        }
        let mut scopes = vec![(StatsScope::Cell, alone), (StatsScope::Neighbourhood, around)];
        let named = self.named.iter().find(|(area, _)| area.contains(cell.middle_m()));
        scopes.extend(named.map(|(_, by_heading)| (StatsScope::Area, by_heading[usize::from(cell.heading)])));
        scopes.push((StatsScope::Map, self.map));
        self.advice_from(&scopes)
    }

    /// Advice from the first of the scopes with enough measurements.
    fn advice_from(&self, scopes: &[(StatsScope, Pool)]) -> ModalityAdvice {
        let mut advice = ModalityAdvice::default();
        for module in Modality::ALL {
            let enough =
                |(_, pool): &&(StatsScope, Pool)| pool.found[module.index()].fixes() >= MIN_MEASUREMENTS;
            if let Some((level, pool)) = scopes.iter().find(enough) {
                // Robot-aligned biases differ from place to place: over the whole map only the
                // variance is inflated.
                let cells = if *level == StatsScope::Map { None } else { Some(pool.cells) };
                advice.faults[module.index()] = pool.found[module.index()].fault(cells);
            }
        }
        // Whole-map statistics never exclude a modality.
        // Departs from method 15, where cells inherit all from their parents.
        let ranked = scopes
            .iter()
            .filter(|(level, _)| *level != StatsScope::Map)
            .find(|(_, pool)| pool.found[Modality::Odometry.index()].available() >= MIN_MEASUREMENTS);
        let Some((level, pool)) = ranked else { return advice };
        let scores = pool.found.map(|evidence| evidence.score());
        let best = Modality::ALL.into_iter().min_by(|a, b| scores[a.index()].total_cmp(&scores[b.index()]));
        let Some(best) = best else { return advice };
        let lowest = scores[best.index()];
        advice.used = match self.mode {
            FusionMode::All => [true; 3],
            FusionMode::NearBest => scores.map(|score| score <= FUSED_SCORE * lowest),
            FusionMode::Best => Modality::ALL.map(|module| module == best),
        };
        (advice.best, advice.level) = (Some(best), *level);
        advice
    }
}
