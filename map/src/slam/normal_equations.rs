//! Sparse symmetric systems of 3x3 blocks: approximate minimum degree order (crate `amd`), then
//! Cholesky (`nalgebra-sparse`). In: blocks by pose. Out: solutions by pose.

use nalgebra::{DMatrix, Matrix3};
use nalgebra_sparse::{
    factorization::{CscCholesky, CscSymbolicCholesky},
    pattern::SparsityPattern,
};

/// Why there is no solution: a matrix that is not positive definite, or has a number that is not
/// finite.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct NotPositiveDefinite;

/// Which blocks of the matrix are not zero, and where each lies in the order of elimination.
pub(super) struct BlockPattern {
    /// Place in the order of elimination, by block row.
    place: Vec<usize>,
    /// Of both triangles, scalar rows of each scalar column.
    scalars: SparsityPattern,
    /// The block rows of each block column in the order of elimination, ascending.
    columns: Vec<Vec<usize>>,
    symbolic: CscSymbolicCholesky,
}

impl BlockPattern {
    /// A matrix of `blocks` x `blocks` with all diagonal blocks and those of `pairs`, each in both
    /// triangles.
    pub(super) fn new(blocks: usize, pairs: impl Iterator<Item = (usize, usize)> + Clone) -> Self {
        let mut neighbours = vec![Vec::new(); blocks];
        for (a, b) in pairs {
            neighbours[a].push(b);
            neighbours[b].push(a);
        }
        for (i, rows) in neighbours.iter_mut().enumerate() {
            rows.push(i);
            rows.sort_unstable();
            rows.dedup();
        }
        let place = elimination_order(&neighbours);
        let mut columns = vec![Vec::new(); blocks];
        for (column, rows) in neighbours.iter().enumerate() {
            let placed = &mut columns[place[column]];
            placed.extend(rows.iter().map(|row| place[*row]));
            placed.sort_unstable();
        }
        let scalars = scalar_pattern(&columns);
        Self { place, symbolic: CscSymbolicCholesky::factor(scalars.clone()), scalars, columns }
    }

    pub(super) fn zeros(&self) -> BlockMatrix<'_> {
        BlockMatrix { pattern: self, values: vec![0.0; self.scalars.nnz()] }
    }

    /// Where a block lies, rows and columns in the order of elimination: a function from element to
    /// value.
    fn block(&self, row: usize, column: usize) -> Option<impl Fn(usize, usize) -> usize> {
        let at = self.columns[column].binary_search(&row).ok()?;
        let offsets = self.scalars.major_offsets();
        let starts = [0, 1, 2].map(|c| offsets[3 * column + c] + 3 * at);
        Some(move |r: usize, c: usize| starts[c] + r)
    }
}

/// The place of each node in an order of little fill: approximate minimum degree; their own order
/// if there is none.
fn elimination_order(neighbours: &[Vec<usize>]) -> Vec<usize> {
    let mut offsets = vec![0];
    let mut rows = Vec::new();
    for column in neighbours {
        rows.extend(column);
        offsets.push(rows.len());
    }
    let ordered = amd::order(neighbours.len(), &offsets, &rows, &amd::Control::default());
    ordered.map_or_else(|_status| (0..neighbours.len()).collect(), |(_, place, _)| place)
}

fn scalar_pattern(columns: &[Vec<usize>]) -> SparsityPattern {
    let n = 3 * columns.len();
    let (mut offsets, mut rows) = (vec![0], Vec::new());
    for column in columns {
        for _ in 0..3 {
            rows.extend(column.iter().flat_map(|row| (0..3).map(move |r| 3 * row + r)));
            offsets.push(rows.len());
        }
    }
    // Rows ascend within each column, and all are below n.
    SparsityPattern::try_from_offsets_and_indices(n, n, offsets, rows)
        .unwrap_or_else(|_| SparsityPattern::zeros(n, n))
}

/// A symmetric matrix of 3x3 blocks.
pub(super) struct BlockMatrix<'a> {
    pattern: &'a BlockPattern,
    values: Vec<f64>,
}

impl<'a> BlockMatrix<'a> {
    /// Adds a block, and off the diagonal its transpose in the other triangle. Blocks outside the
    /// pattern are left out.
    pub(super) fn add(&mut self, row: usize, column: usize, block: &Matrix3<f64>) {
        let (row, column) = (self.pattern.place[row], self.pattern.place[column]);
        self.add_placed(row, column, block);
        if row != column {
            self.add_placed(column, row, &block.transpose());
        }
    }

    fn add_placed(&mut self, row: usize, column: usize, block: &Matrix3<f64>) {
        let Some(at) = self.pattern.block(row, column) else { return };
        for c in 0..3 {
            for r in 0..3 {
                self.values[at(r, c)] += block[(r, c)];
            }
        }
    }

    /// Changes every element of the diagonal.
    pub(super) fn change_diagonal(&mut self, change: impl Fn(f64) -> f64) {
        for i in 0..self.pattern.place.len() {
            let Some(at) = self.pattern.block(i, i) else { continue };
            for k in 0..3 {
                let value = &mut self.values[at(k, k)];
                *value = change(*value);
            }
        }
    }

    /// Factorises the matrix.
    pub(super) fn factor(self) -> Result<Factor<'a>, NotPositiveDefinite> {
        if self.values.iter().any(|value| !value.is_finite()) {
            return Err(NotPositiveDefinite);
        }
        let made = CscCholesky::factor_numerical(self.pattern.symbolic.clone(), &self.values);
        Ok(Factor { pattern: self.pattern, cholesky: made.or(Err(NotPositiveDefinite))? })
    }
}

/// A factorised matrix.
pub(super) struct Factor<'a> {
    pattern: &'a BlockPattern,
    cholesky: CscCholesky<f64>,
}

impl Factor<'_> {
    /// Solves for a right-hand side, three numbers a block.
    pub(super) fn solve(&self, right: &[f64]) -> Vec<f64> {
        let mut x = DMatrix::zeros(right.len(), 1);
        for (block, place) in self.pattern.place.iter().enumerate() {
            for k in 0..3 {
                x[(3 * place + k, 0)] = right[3 * block + k];
            }
        }
        self.cholesky.solve_mut(&mut x);
        let at = |i: usize| x[(3 * self.pattern.place[i / 3] + i % 3, 0)];
        (0..right.len()).map(at).collect()
    }

    /// The diagonal block of the inverse.
    pub(super) fn inverse_block(&self, block: usize) -> Matrix3<f64> {
        let (n, place) = (3 * self.pattern.place.len(), self.pattern.place[block]);
        let mut x = DMatrix::from_fn(n, 3, |row, column| f64::from(u8::from(row == 3 * place + column)));
        self.cholesky.solve_mut(&mut x);
        Matrix3::from_fn(|r, c| x[(3 * place + r, c)])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt as _, SeedableRng as _};
    use rand_chacha::ChaCha8Rng;

    /// A block with its row and column.
    type Entry = (usize, usize, Matrix3<f64>);

    /// A chain with chords, and the same matrix as a dense one.
    fn system(blocks: usize) -> (BlockPattern, Vec<Entry>, DMatrix<f64>) {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let mut pairs: Vec<(usize, usize)> = (1..blocks).map(|i| (i - 1, i)).collect();
        pairs.extend((0..blocks / 4).map(|i| (i, blocks - 1 - i)));
        let mut entries = Vec::new();
        for &(a, b) in &pairs {
            let j = Matrix3::from_fn(|_, _| rng.random_range(-1.0..1.0));
            entries.push((a, a, j.transpose() * j));
            entries.push((b, b, j.transpose() * j));
            entries.push((b, a, -(j.transpose() * j)));
        }
        entries.push((0, 0, Matrix3::identity()));
        let mut dense = DMatrix::zeros(3 * blocks, 3 * blocks);
        for (row, column, block) in &entries {
            let mut part = dense.fixed_view_mut::<3, 3>(3 * row, 3 * column);
            part += block;
            if row != column {
                let mut part = dense.fixed_view_mut::<3, 3>(3 * column, 3 * row);
                part += block.transpose();
            }
        }
        (BlockPattern::new(blocks, pairs.into_iter()), entries, dense)
    }

    #[test]
    fn solutions_are_those_of_the_dense_matrix() {
        let (pattern, entries, mut dense) = system(24);
        let mut matrix = pattern.zeros();
        for (row, column, block) in &entries {
            matrix.add(*row, *column, block);
        }
        matrix.change_diagonal(|d| d * 1.5 + 0.1);
        for i in 0..dense.nrows() {
            dense[(i, i)] = dense[(i, i)] * 1.5 + 0.1;
        }
        let factor = matrix.factor().unwrap();
        let right: Vec<f64> = (0..72).map(|i| f64::from(i % 7) - 3.0).collect();
        let wanted = dense.clone().cholesky().unwrap().solve(&DMatrix::from_column_slice(72, 1, &right));
        let found = factor.solve(&right);
        assert!(found.iter().zip(wanted.iter()).all(|(a, b)| (a - b).abs() < 1e-9));
        let inverse = dense.try_inverse().unwrap();
        for block in [0, 7, 23] {
            let wanted = inverse.fixed_view::<3, 3>(3 * block, 3 * block).into_owned();
            assert!((factor.inverse_block(block) - wanted).norm() < 1e-9);
        }
    }

    #[test]
    fn a_matrix_that_is_not_positive_definite_is_refused() {
        let (pattern, ..) = system(5);
        let mut matrix = pattern.zeros();
        matrix.change_diagonal(|_| -1.0);
        assert!(matrix.factor().is_err());
        let mut matrix = pattern.zeros();
        matrix.change_diagonal(|_| f64::NAN);
        assert!(matrix.factor().is_err());
    }

    /// The order keeps a long chain with chords nearly as sparse as it is.
    #[test]
    fn the_order_keeps_the_factor_sparse() {
        let (pattern, ..) = system(400);
        let (matrix, factor) = (pattern.scalars.nnz(), pattern.symbolic.l_pattern().nnz());
        assert!(factor < 2 * matrix, "{factor} of {matrix}");
    }
}
