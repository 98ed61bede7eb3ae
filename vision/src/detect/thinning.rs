//! Edge mask in, the same mask one pixel wide out (method 1.2), and the number of branches that meet in a pixel.
//!
//! Both look only at the ring of eight neighbours, coded as one byte; the answers for all 256 codes are tables made at
//! compile time.

/// The ring of neighbours (du, dv), clockwise on screen from the one above. Bit i of a ring code is neighbour i.
pub(crate) const RING: [(i32, i32); 8] =
    [(0, -1), (1, -1), (1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1)];

/// Whether the pixel is the corner of a staircase: two neighbours side to side with it at a right angle, and all
/// neighbours still touch each other without it.
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

/// Number of 8-connected groups among the neighbours: 1 at an end, 2 along a line, 3 and more at a junction.
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
        // Along the ring, and across its corners: the neighbours above and to the right touch diagonally.
        touches += here & next;
        touches += here & after & (1 - next) & (1 - (i as usize & 1));
        i += 1;
    }
    // A closed ring has as many touches as pixels, yet is one group.
    if touches >= set { 1 } else { (set - touches) as u8 }
}

/// Ring code of pixel `at` of a row-major mask. The pixel must not lie on the image border.
#[inline]
pub(crate) fn ring_code(mask: &[bool], width: usize, at: usize) -> usize {
    let (above, below) = (&mask[at - width - 1..at - width + 2], &mask[at + width - 1..at + width + 2]);
    usize::from(above[1])
        | usize::from(above[2]) << 1
        | usize::from(mask[at + 1]) << 2
        | usize::from(below[2]) << 3
        | usize::from(below[1]) << 4
        | usize::from(below[0]) << 5
        | usize::from(mask[at - 1]) << 6
        | usize::from(above[0]) << 7
}

/// Clears staircase corners in `mask` and `pixels` (row-major, none on the border) alike. Of two corners that touch,
/// the weaker goes: which one must not depend on how the image lies.
pub(crate) fn thin(mask: &mut [bool], width: usize, magnitude: &[f32], pixels: &mut Vec<u32>) {
    let removable = |mask: &[bool], at: usize| mask[at] && REMOVABLE[ring_code(mask, width, at)];
    let corners: Vec<usize> =
        pixels.iter().map(|&at| at as usize).filter(|&at| removable(mask, at)).collect();
    for weakest in [true, false] {
        for &at in &corners {
            let beaten = weakest
                && [at - width, at - 1, at + 1, at + width]
                    .into_iter()
                    .any(|near| magnitude[near] < magnitude[at] && removable(mask, near));
            if !beaten && removable(mask, at) {
                mask[at] = false;
            }
        }
    }
    pixels.retain(|&at| mask[at as usize]);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn thinned(picture: &str) -> String {
        let rows: Vec<&str> = picture.split_whitespace().collect();
        let width = rows[0].len();
        let mut mask: Vec<bool> = rows.concat().bytes().map(|b| b == b'#').collect();
        let mut pixels: Vec<u32> = (0..mask.len() as u32).filter(|&i| mask[i as usize]).collect();
        thin(&mut mask, width, &vec![1.0; rows.len() * width], &mut pixels);
        assert_eq!(pixels.len(), mask.iter().filter(|m| **m).count());
        mask.chunks(width)
            .map(|row| row.iter().map(|m| if *m { '#' } else { '.' }).collect::<String>())
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
