//! Edge mask in, the same mask one pixel wide out (method 1.2), and the number of branches that
//! meet in a pixel.
//!
//! Both look only at the ring of eight neighbours, coded as one byte; the answers for all 256 codes
//! are tables made at compile time.

/// Mark of an edge pixel; all others have mark 0.
pub(crate) const EDGE: u8 = 1;

/// The ring of neighbours (du, dv), clockwise on screen from the one above. Bit i of a ring code is
/// neighbour i.
pub(crate) const RING: [(i32, i32); 8] =
    [(0, -1), (1, -1), (1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1)];

/// Whether the pixel is the corner of a staircase: two neighbours side to side with it at a right
/// angle, and all neighbours still touch each other without it.
const REMOVABLE: [bool; 256] = {
    let mut table = [false; 256];
    let mut code = 0;
    while code < 256 {
        let mut corner = false;
        let mut i = 0;
        while i < 8 {
            corner |= (code >> i) & 1 == 1 && (code >> ((i + 2) % 8)) & 1 == 1;
            i += 2;
        }
        table[code] = corner && branches(code) == 1;
        code += 1;
    }
    table
};

/// Number of 8-connected groups among the neighbours: 1 at an end, 2 along a line, 3 and more at a
/// junction.
pub(crate) const BRANCHES: [u8; 256] = {
    let mut table = [0; 256];
    let mut code = 0;
    while code < 256 {
        table[code] = branches(code);
        code += 1;
    }
    table
};

const fn branches(code: usize) -> u8 {
    if code == 0 {
        return 0;
    }
    let mut touches = 0;
    let mut set = 0;
    let mut i = 0;
    while i < 8 {
        let (here, next, after) = ((code >> i) & 1, (code >> ((i + 1) % 8)) & 1, (code >> ((i + 2) % 8)) & 1);
        set += here;
        // Along the ring, and across its corners: the neighbours above and to the right touch
        // diagonally.
        touches += here & next;
        touches += here & after & (1 - next) & (1 - (i as usize & 1));
        i += 1;
    }
    // A closed ring has as many touches as pixels, yet is one group.
    if touches >= set { 1 } else { (set - touches) as u8 }
}

/// Ring codes of the 3x3 blocks, whose pixels count row by row from bit 0; the centre does not
/// matter.
const RINGS: [u8; 512] = {
    let mut table = [0; 512];
    let mut block = 0;
    while block < 512 {
        let mut i = 0;
        while i < 8 {
            let (du, dv) = RING[i];
            let bit = (dv + 1) * 3 + du + 1;
            table[block] |= ((block >> bit & 1) << i) as u8;
            i += 1;
        }
        block += 1;
    }
    table
};

/// Ring code of pixel `at`: which neighbours have bit [`EDGE`] in a row-major plane. The pixel must
/// lie off the border by two rows. For planes at rest: reading four marks at once stalls when one
/// of them was just written.
#[inline]
pub(crate) fn ring_code(marks: &[u8], width: usize, at: usize) -> usize {
    // Three neighbouring marks, their bits side by side.
    let three = |start: usize| {
        let marks = marks[start..].first_chunk::<4>().map_or(0, |m| u32::from_le_bytes(*m));
        ((marks & 0x0001_0101).wrapping_mul(0x0001_0204) >> 16 & 7) as usize
    };
    RINGS[three(at - width - 1) | three(at - 1) << 3 | three(at + width - 1) << 6].into()
}

/// The same for planes that change: mark by mark.
#[inline]
pub(crate) fn changing_ring_code(marks: &[u8], width: usize, at: usize) -> usize {
    let three = |start: usize| &marks[start..start + 3];
    let (above, level, below) = (three(at - width - 1), three(at - 1), three(at + width - 1));
    let bit = |mark: u8, i: usize| usize::from(mark & EDGE) << i;
    (bit(above[1], 0) | bit(above[2], 1) | bit(level[2], 2) | bit(below[2], 3))
        | (bit(below[1], 4) | bit(below[0], 5) | bit(level[0], 6) | bit(above[0], 7))
}

/// Clears staircase corners in both `marks` and `pixels` (row-major, none within two rows of the
/// border). Of two corners that touch, the weaker is removed: the choice must not depend on the
/// orientation of the image. `corners` is scratch.
pub(crate) fn thin(
    marks: &mut [u8],
    width: usize,
    strength: impl Fn(usize) -> f32,
    pixels: &mut Vec<u32>,
    corners: &mut Vec<u32>,
) {
    let removable =
        |marks: &[u8], at: usize| marks[at] == EDGE && REMOVABLE[changing_ring_code(marks, width, at)];
    corners.clear();
    corners.extend_from_slice(pixels);
    keep(corners, |at| REMOVABLE[ring_code(marks, width, at)]);
    for weakest in [true, false] {
        for at in corners.iter().map(|at| *at as usize) {
            if !removable(marks, at) {
                continue;
            }
            let beaten = weakest
                && [at - width, at - 1, at + 1, at + width]
                    .into_iter()
                    .any(|near| removable(marks, near) && strength(near) < strength(at));
            if !beaten {
                marks[at] = 0;
            }
        }
    }
    keep(pixels, |at| marks[at] == EDGE);
}

/// Keeps the pixels that pass. Unlike `retain`, without a branch on the outcome, which is
/// unpredictable here.
pub(crate) fn keep(pixels: &mut Vec<u32>, mut passes: impl FnMut(usize) -> bool) {
    let mut count = 0;
    for i in 0..pixels.len() {
        let at = pixels[i];
        pixels[count] = at;
        count += usize::from(passes(at as usize));
    }
    pixels.truncate(count);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn thinned(picture: &str) -> String {
        let rows: Vec<&str> = picture.split_whitespace().collect();
        let width = rows[0].len();
        let mut marks: Vec<u8> = rows.concat().bytes().map(|b| u8::from(b == b'#')).collect();
        let mut pixels: Vec<u32> = (0..marks.len() as u32).filter(|&i| marks[i as usize] == EDGE).collect();
        thin(&mut marks, width, |_| 1.0, &mut pixels, &mut vec![]);
        assert_eq!(pixels.len(), marks.iter().map(|m| usize::from(*m)).sum::<usize>());
        marks
            .chunks(width)
            .map(|row| row.iter().map(|m| if *m == EDGE { '#' } else { '.' }).collect::<String>())
            .collect::<Vec<_>>()
            .join(" ")
    }

    #[test]
    fn staircases_become_diagonals_and_lines_stay() {
        assert_eq!(thinned("...... .##... ..##.. ...##. ......"), "...... .#.... ..#... ...##. ......");
        assert_eq!(thinned("...... .####. ......"), "...... .####. ......");
        assert_eq!(thinned("..... .#.#. ..#.. .#.#. ....."), "..... .#.#. ..#.. .#.#. .....");
    }

    #[test]
    fn lines_two_pixels_wide_do_not_vanish() {
        assert_eq!(thinned("...... .####. .####. ......"), "...... ....#. .###.. ......");
        assert_eq!(thinned(".... .##. .##. .##. ...."), ".... ..#. ..#. .#.. ....");
    }

    #[test]
    fn both_ways_to_read_a_ring_agree() {
        for code in 0..256 {
            // A plane 5 wide; marks have other bits too.
            let mut marks = [6_u8; 25];
            for (i, (du, dv)) in RING.into_iter().enumerate() {
                marks[(12 + 5 * dv + du) as usize] |= (code >> i & 1) as u8;
            }
            for centre in [6, 7] {
                marks[12] = centre;
                assert_eq!(ring_code(&marks, 5, 12), code);
                assert_eq!(changing_ring_code(&marks, 5, 12), code);
            }
        }
    }

    #[test]
    fn tables_agree_with_a_flood_fill_of_the_ring() {
        for (code, branches) in BRANCHES.into_iter().enumerate() {
            let set: Vec<(i32, i32)> = (0..8).filter(|i| code >> i & 1 == 1).map(|i| RING[i]).collect();
            let mut left = set.clone();
            let mut groups = 0;
            while let Some(seed) = left.pop() {
                groups += 1;
                let mut stack = vec![seed];
                while let Some((u, v)) = stack.pop() {
                    let (near, far): (Vec<_>, Vec<_>) =
                        left.into_iter().partition(|(a, b)| (a - u).abs() <= 1 && (b - v).abs() <= 1);
                    stack.extend(near);
                    left = far;
                }
            }
            assert_eq!(branches, groups, "ring {code:08b}");
        }
    }
}
