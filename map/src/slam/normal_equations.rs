//! Sparse symmetric systems of blocks of mixed size: approximate minimum degree order (crate
//! `amd`), then Cholesky (`nalgebra-sparse`). In: blocks by variable. Out: solutions and parts of
//! the inverse by variable.

use nalgebra::{DMatrix, Dim, Matrix, RawStorage};
use nalgebra_sparse::{
    factorization::{CscCholesky, CscSymbolicCholesky},
    pattern::SparsityPattern,
};

/// Why there is no solution: a matrix that is not positive definite, or has a number that is not
/// finite.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct NotPositiveDefinite;

/// Which blocks of the matrix are not zero, and where each lies in the order of elimination.
pub(crate) struct BlockPattern {
    /// Place in the order of elimination, by block row.
    place: Vec<usize>,
    /// First scalar row of each block row, and their number, in the caller's order.
    starts: Vec<usize>,
    /// First scalar row of each place, and their number, in the order of elimination.
    placed_starts: Vec<usize>,
    /// Of both triangles, scalar rows of each scalar column.
    scalars: SparsityPattern,
    /// The block rows of each block column in the order of elimination, ascending.
    columns: Vec<Vec<usize>>,
    symbolic: CscSymbolicCholesky,
}

impl BlockPattern {
    /// A matrix with a block row of each size, all diagonal blocks and those of `pairs`, each in
    /// both triangles.
    pub(crate) fn new(sizes: &[usize], pairs: impl Iterator<Item = (usize, usize)>) -> Self {
        let mut neighbours: Vec<Vec<usize>> = (0..sizes.len()).map(|i| vec![i]).collect();
        for (a, b) in pairs {
            neighbours[a].push(b);
            neighbours[b].push(a);
        }
        for rows in &mut neighbours {
            rows.sort_unstable();
            rows.dedup();
        }
        let place = elimination_order(&neighbours);
        let mut columns = vec![Vec::new(); sizes.len()];
        let mut placed_sizes = vec![0; sizes.len()];
        for (column, rows) in neighbours.iter().enumerate() {
            placed_sizes[place[column]] = sizes[column];
            let placed = &mut columns[place[column]];
            placed.extend(rows.iter().map(|row| place[*row]));
            placed.sort_unstable();
        }
        let (starts, placed_starts) = (sums(sizes), sums(&placed_sizes));
        let scalars = scalar_pattern(&columns, &placed_starts);
        let symbolic = CscSymbolicCholesky::factor(scalars.clone());
        Self { place, starts, placed_starts, scalars, columns, symbolic }
    }

    /// Scalar rows of a block row, in the caller's order.
    pub(crate) fn rows(&self, block: usize) -> std::ops::Range<usize> {
        self.starts[block]..self.starts[block + 1]
    }

    pub(crate) fn zeros(&self) -> BlockMatrix<'_> {
        BlockMatrix { pattern: self, values: vec![0.0; self.scalars.nnz()] }
    }

    /// Where a block lies, rows and columns in the order of elimination: a function from element to
    /// value.
    fn block(&self, row: usize, column: usize) -> Option<impl Fn(usize, usize) -> usize> {
        let rows = &self.columns[column];
        let at = rows.binary_search(&row).ok()?;
        let above: usize =
            rows[..at].iter().map(|&r| self.placed_starts[r + 1] - self.placed_starts[r]).sum();
        let (offsets, first) = (self.scalars.major_offsets(), self.placed_starts[column]);
        Some(move |r: usize, c: usize| offsets[first + c] + above + r)
    }
}

/// Sums of what comes before each, and of all.
fn sums(sizes: &[usize]) -> Vec<usize> {
    let mut all = vec![0];
    for size in sizes {
        all.push(all[all.len() - 1] + size);
    }
    all
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

fn scalar_pattern(columns: &[Vec<usize>], starts: &[usize]) -> SparsityPattern {
    let n = starts[columns.len()];
    let (mut offsets, mut rows) = (vec![0], Vec::new());
    for (i, column) in columns.iter().enumerate() {
        for _ in starts[i]..starts[i + 1] {
            rows.extend(column.iter().flat_map(|&row| starts[row]..starts[row + 1]));
            offsets.push(rows.len());
        }
    }
    // Rows ascend within each column, and all are below n.
    SparsityPattern::try_from_offsets_and_indices(n, n, offsets, rows)
        .unwrap_or_else(|_| SparsityPattern::zeros(n, n))
}

/// A symmetric matrix of blocks.
pub(crate) struct BlockMatrix<'a> {
    pattern: &'a BlockPattern,
    values: Vec<f64>,
}

impl<'a> BlockMatrix<'a> {
    /// Adds a block, and off the diagonal its transpose in the other triangle. Blocks outside the
    /// pattern are left out.
    pub(crate) fn add<R: Dim, C: Dim, S: RawStorage<f64, R, C>>(
        &mut self,
        row: usize,
        column: usize,
        block: &Matrix<f64, R, C, S>,
    ) {
        let (placed_row, placed_column) = (self.pattern.place[row], self.pattern.place[column]);
        let shape = block.shape();
        self.add_placed(placed_row, placed_column, shape, |r, c| block[(r, c)]);
        if row != column {
            self.add_placed(placed_column, placed_row, (shape.1, shape.0), |r, c| block[(c, r)]);
        }
    }

    fn add_placed(
        &mut self,
        row: usize,
        column: usize,
        (rows, columns): (usize, usize),
        element: impl Fn(usize, usize) -> f64,
    ) {
        let Some(at) = self.pattern.block(row, column) else { return };
        for c in 0..columns {
            for r in 0..rows {
                self.values[at(r, c)] += element(r, c);
            }
        }
    }

    /// Changes every element of the diagonal.
    pub(crate) fn change_diagonal(&mut self, change: impl Fn(f64) -> f64) {
        let starts = &self.pattern.placed_starts;
        for i in 0..self.pattern.place.len() {
            let Some(at) = self.pattern.block(i, i) else { continue };
            for k in 0..starts[i + 1] - starts[i] {
                let value = &mut self.values[at(k, k)];
                *value = change(*value);
            }
        }
    }

    /// Factorises the matrix.
    pub(crate) fn factor(self) -> Result<Factor<'a>, NotPositiveDefinite> {
        if self.values.iter().any(|value| !value.is_finite()) {
            return Err(NotPositiveDefinite);
        }
        let made = CscCholesky::factor_numerical(self.pattern.symbolic.clone(), &self.values);
        Ok(Factor { pattern: self.pattern, cholesky: made.or(Err(NotPositiveDefinite))? })
    }
}

/// A factorised matrix.
pub(crate) struct Factor<'a> {
    pattern: &'a BlockPattern,
    cholesky: CscCholesky<f64>,
}

impl Factor<'_> {
    /// Solves for a right-hand side in the caller's order.
    pub(crate) fn solve(&self, right: &[f64]) -> Vec<f64> {
        let pattern = self.pattern;
        let mut x = DMatrix::zeros(right.len(), 1);
        for (block, &place) in pattern.place.iter().enumerate() {
            for (k, row) in pattern.rows(block).enumerate() {
                x[(pattern.placed_starts[place] + k, 0)] = right[row];
            }
        }
        self.cholesky.solve_mut(&mut x);
        let mut solution = Vec::with_capacity(right.len());
        for (block, &place) in pattern.place.iter().enumerate() {
            let first = pattern.placed_starts[place];
            solution.extend((0..pattern.rows(block).len()).map(|k| x[(first + k, 0)]));
        }
        solution
    }

    /// The rows and columns of the inverse that belong to some blocks, in the order given.
    pub(crate) fn inverse_of(&self, blocks: &[usize]) -> DMatrix<f64> {
        let placed = |&block: &usize| {
            let place = self.pattern.place[block];
            self.pattern.placed_starts[place]..self.pattern.placed_starts[place + 1]
        };
        let rows: Vec<usize> = blocks.iter().flat_map(placed).collect();
        let n = self.pattern.starts[self.pattern.place.len()];
        let mut inverse = DMatrix::zeros(rows.len(), rows.len());
        for (first, columns) in rows.chunks(COLUMNS_AT_ONCE).enumerate() {
            let mut x = DMatrix::zeros(n, columns.len());
            for (c, &row) in columns.iter().enumerate() {
                x[(row, c)] = 1.0;
            }
            self.cholesky.solve_mut(&mut x);
            for c in 0..columns.len() {
                for (r, &row) in rows.iter().enumerate() {
                    inverse[(r, first * COLUMNS_AT_ONCE + c)] = x[(row, c)];
                }
            }
        }
        inverse
    }
}

/// Columns of the inverse that are computed together: bounds the memory of a long drive.
const COLUMNS_AT_ONCE: usize = 64;

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Matrix3;
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
        (BlockPattern::new(&vec![3; blocks], pairs.into_iter()), entries, dense)
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
            assert!((factor.inverse_of(&[block]) - wanted).norm() < 1e-9);
        }
    }

    /// Blocks of 2, 3, 8 and 10 rows, one of them joined with all others.
    #[test]
    fn blocks_of_mixed_size_are_those_of_the_dense_matrix() {
        let mut rng = ChaCha8Rng::seed_from_u64(6);
        let sizes: Vec<usize> = (0..70).map(|i| [3, 2, 8][i % 3]).chain([10]).collect();
        let starts = sums(&sizes);
        let pairs: Vec<(usize, usize)> = (1..70).flat_map(|i| [(i, i - 1), (70, i)]).collect();
        let pattern = BlockPattern::new(&sizes, pairs.iter().copied());
        let (mut matrix, mut dense) = (pattern.zeros(), DMatrix::<f64>::identity(starts[71], starts[71]));
        matrix.change_diagonal(|_| 1.0);
        for &(a, b) in &pairs {
            let j = [a, b].map(|i| DMatrix::from_fn(6, sizes[i], |_, _| rng.random_range(-1.0..1.0)));
            for (row, column, block) in
                [(a, a, j[0].tr_mul(&j[0])), (b, b, j[1].tr_mul(&j[1])), (a, b, j[0].tr_mul(&j[1]))]
            {
                matrix.add(row, column, &block);
                let mut part = dense.view_mut((starts[row], starts[column]), block.shape());
                part += &block;
                if row != column {
                    let mut part =
                        dense.view_mut((starts[column], starts[row]), (block.ncols(), block.nrows()));
                    part += block.transpose();
                }
            }
        }
        let factor = matrix.factor().unwrap();
        let inverse = dense.try_inverse().unwrap();
        let right: Vec<f64> = (0..starts[71]).map(|i| (i % 7) as f64 - 3.0).collect();
        let wanted = &inverse * DMatrix::from_column_slice(right.len(), 1, &right);
        assert!(factor.solve(&right).iter().zip(wanted.iter()).all(|(a, b)| (a - b).abs() < 1e-9));
        let chosen = [70, 0, 5, 44, 2];
        let rows: Vec<usize> = chosen.iter().flat_map(|&i| pattern.rows(i)).collect();
        let wanted = inverse.select_rows(&rows).select_columns(&rows);
        assert!((factor.inverse_of(&chosen) - wanted).norm() < 1e-9);
        // More columns than are computed together.
        let all: Vec<usize> = (0..71).collect();
        assert!((factor.inverse_of(&all) - inverse).norm() < 1e-8);
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
