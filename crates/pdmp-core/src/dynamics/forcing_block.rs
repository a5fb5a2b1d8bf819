//! Forcing of blocks of groups, for many movements.

use crate::dynamics::forcing_table::{Cubic, ForcingTable, evaluate};
use crate::dynamics::output_system::CubicSample;
use crate::numerics::blocks::Block;

impl ForcingTable {
    /// Returns the cells of clocks `u` and the clocks since their first knots, for clocks from 0 to the end.
    #[inline(always)]
    pub(crate) fn positions<B: Block>(&self, u: B) -> [B; 2] {
        let position = u * self.cells_per_clock;
        let cell = position.floor();
        [cell, (position - cell) * self.cell_width]
    }

    /// Returns the forcing of a style and its slope as [`ForcingTable::sample`] does, for the block of groups from `group` on. J is
    /// the number of styles, or zero for any number.
    #[inline(always)]
    pub(crate) fn sample_block<B: Block, const J: usize>(
        &self,
        [cell, t]: [f64; 2],
        group: usize,
        style: &[f64],
    ) -> CubicSample<B> {
        // A known number of styles leaves one check of bounds.
        let n_styles = if J == 0 { self.n_styles } else { J };
        let start = cell as u32 as usize * self.knot_stride + group * n_styles;
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
        evaluate(B::in_order(sum), t)
    }
}

/// Adds a weighted cubic to a sum, or begins the sum with it: a sum with zero would change the sign of zero.
#[inline(always)]
fn add<B: Block>(sum: &mut [B; 4], first: &Cubic, second: &Cubic, weight: f64, begins: bool) {
    let (cubic, mut i) = (B::load_four(&first.0, &second.0), 0);
    while i < 4 {
        let product = cubic[i] * weight;
        sum[i] = if begins { product } else { sum[i] + product };
        i += 1;
    }
}
