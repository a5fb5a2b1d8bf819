//! Forcing of blocks of groups, for many movements.

use crate::dynamics::forcing_table::{Cubic, ForcingTable, TableIndex, evaluate};
use crate::dynamics::output_system::CubicSample;
use crate::numerics::blocks::Block;

impl ForcingTable {
    /// Returns the forcing of a style and its slope as [`ForcingTable::sample`] does, for the block of groups from `group` on. J is
    /// the number of styles, or zero for any number.
    #[inline(always)]
    pub(crate) fn sample_block<B: Block, const J: usize>(
        &self,
        index: TableIndex,
        group: usize,
        style: &[f64],
    ) -> CubicSample<B> {
        // A known number of styles leaves one check of bounds.
        let n_styles = if J == 0 { self.n_styles } else { J };
        let start = index.first + group * n_styles;
        let (first, rest) = self.cubics[start..start + B::GROUPS * n_styles].split_at(n_styles);
        let second = if B::GROUPS == 2 { rest } else { first };
        let mut sum = [B::default(); 4];
        if J == 0 {
            #[allow(clippy::needless_range_loop)] // See `Kernel`.
            for j in 0..style.len().min(first.len()).min(second.len()) {
                add(&mut sum, &first[j], &second[j], style[j], j == 0);
            }
        } else if let (Some(first), Some(second), Some(style)) =
            (first.first_chunk::<J>(), second.first_chunk::<J>(), style.first_chunk::<J>())
        {
            let mut j = 0;
            while j < J {
                add(&mut sum, &first[j], &second[j], style[j], j == 0);
                j += 1;
            }
        }
        evaluate(sum, index.t)
    }
}

/// Adds a weighted cubic to a sum, or begins the sum with it: a sum with zero would change the sign of zero.
#[inline(always)]
fn add<B: Block>(sum: &mut [B; 4], first: &Cubic, second: &Cubic, weight: f64, begins: bool) {
    let mut i = 0;
    while i < 4 {
        let product = B::join(&first.0[i], &second.0[i]) * weight;
        sum[i] = if begins { product } else { sum[i] + product };
        i += 1;
    }
}
