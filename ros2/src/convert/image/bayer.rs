//! Colours of a sensor with one colour a pixel (Bayer's pattern). In: a level each pixel. Out: red,
//! green and blue, those that a pixel lacks as the mean of its neighbours'.

/// Pixels of red, green and blue, row-major. `red` is the place of red in each square of four; blue
/// is across. Sides are even.
pub(super) fn rgb_of_bayer(
    levels: &[u8],
    [width, height]: [usize; 2],
    red: [usize; 2],
) -> impl Iterator<Item = [u8; 3]> {
    (0..height).flat_map(move |y| {
        (0..width).map(move |x| {
            // Over the edge the neighbour on the other side has the same colour.
            let (left, right) =
                (x.checked_sub(1).unwrap_or(1), if x + 1 < width { x + 1 } else { width - 2 });
            let (up, down) = (y.checked_sub(1).unwrap_or(1), if y + 1 < height { y + 1 } else { height - 2 });
            let level = |x: usize, y: usize| u16::from(levels[y * width + x]);
            let mean = |sum: u16, shift: u16| ((sum + shift) >> shift) as u8;
            let own = levels[y * width + x];
            let beside = mean(level(left, y) + level(right, y), 1);
            let above = mean(level(x, up) + level(x, down), 1);
            let cross = mean(level(left, y) + level(right, y) + level(x, up) + level(x, down), 2);
            let corners =
                mean(level(left, up) + level(right, up) + level(left, down) + level(right, down), 2);
            match (x % 2 == red[0], y % 2 == red[1]) {
                (true, true) => [own, cross, corners],
                (false, false) => [corners, cross, own],
                (false, true) => [beside, own, above],
                (true, false) => [above, own, beside],
            }
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_colour_over_all_comes_back() {
        let colour = [200, 120, 40];
        for red in [[0, 0], [1, 0], [0, 1], [1, 1]] {
            let level = |i: usize| match ((i % 6) % 2 == red[0], (i / 6) % 2 == red[1]) {
                (true, true) => colour[0],
                (false, false) => colour[2],
                _ => colour[1],
            };
            let levels: Vec<u8> = (0..24).map(level).collect();
            let pixels: Vec<[u8; 3]> = rgb_of_bayer(&levels, [6, 4], red).collect();
            assert_eq!(pixels, vec![colour; 24], "{red:?}");
        }
    }
}
