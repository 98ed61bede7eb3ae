//! Mean and leading modes of the views of a landmark, as pictures (method 7.2). Recognition
//! compares with the exemplars, never with these; they are stored at the end of a model's bytes.

use crate::{
    icon::MAX_ICON_SIZE,
    learn::pca::{MODES, Modes},
};

/// Mean icon and modes.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Components {
    size: usize,
    pictures: Vec<Vec<u8>>,
}

impl Components {
    /// Most bytes that they take.
    pub(super) const MAX_BYTES: usize = (1 + MODES) * MAX_ICON_SIZE * MAX_ICON_SIZE + Self::END_BYTES;
    /// Side (u16) and number of pictures (u8), behind them.
    const END_BYTES: usize = 3;

    /// In whole grey levels. A mode has 128 for 0, and its largest entry at 1 or 255; it is of norm
    /// 1, which gives its scale.
    pub(crate) fn new(size: usize, of: &Modes) -> Self {
        let mean = of.mean.iter().map(|g| g.round().clamp(0.0, 255.0) as u8).collect();
        let mode = |mode: &Vec<f64>| {
            let peak = mode.iter().fold(f64::MIN_POSITIVE, |peak, e| peak.max(e.abs()));
            mode.iter().map(|e| (128.0 + 127.0 * e / peak).round() as u8).collect()
        };
        Self { size, pictures: std::iter::once(mean).chain(of.modes.iter().map(mode)).collect() }
    }

    /// Their side, in icon pixels.
    pub fn size(&self) -> usize {
        self.size
    }

    /// The mean icon, then the modes by falling variance, row by row. Empty without any.
    pub fn pictures(&self) -> &[Vec<u8>] {
        &self.pictures
    }

    pub(super) fn write(&self, out: &mut Vec<u8>) {
        self.pictures.iter().for_each(|picture| out.extend(picture));
        out.extend((self.size as u16).to_le_bytes());
        out.push(self.pictures.len() as u8);
    }

    /// Splits them off the end of a model's content. `None` if it does not end in pictures.
    pub(super) fn split(content: &[u8]) -> Option<(&[u8], Self)> {
        let (before, &[low, high, count]) = content.split_last_chunk()?;
        let (size, count) = (usize::from(u16::from_le_bytes([low, high])), usize::from(count));
        let pixels = size * size;
        if size > MAX_ICON_SIZE || count > 1 + MODES || before.len() < count * pixels {
            return None;
        }
        let (before, pictures) = before.split_at(before.len() - count * pixels);
        let pictures = pictures.chunks_exact(pixels.max(1)).map(<[u8]>::to_vec).collect::<Vec<_>>();
        (pictures.len() == count).then_some((before, Self { size, pictures }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::learn::pca::modes;

    #[test]
    fn mean_and_modes_are_whole_grey_levels_about_128() {
        let icons: [&[f32]; 3] =
            [&[10.0, 20.4, 30.0, 40.0], &[10.0, 20.4, 34.0, 40.0], &[10.0, 20.4, 26.0, 40.0]];
        let made = Components::new(2, &modes(&icons).unwrap());
        let [mean, mode] = made.pictures() else { panic!("{made:?}") };
        assert_eq!(mean, &[10, 20, 30, 40]);
        assert!(mode == &[128, 128, 255, 128] || mode == &[128, 128, 1, 128], "{mode:?}");
        let mut bytes = vec![7, 7];
        made.write(&mut bytes);
        assert_eq!(Components::split(&bytes), Some((&[7, 7][..], made)));
    }

    #[test]
    fn what_is_no_end_of_a_model_is_refused() {
        let end = |size: usize, count: usize, bytes: usize| {
            let mut all = vec![9; bytes];
            all.extend((size as u16).to_le_bytes());
            all.push(count as u8);
            Components::split(&all).map(|(before, made)| (before.len(), made.pictures.len()))
        };
        let most = Components::MAX_BYTES - Components::END_BYTES;
        assert_eq!(end(MAX_ICON_SIZE, 1 + MODES, most), Some((0, 1 + MODES)));
        assert_eq!(end(MAX_ICON_SIZE + 1, 1, 2 * most), None);
        assert_eq!(end(2, 2 + MODES, 100), None);
        assert_eq!(end(2, 3, 11), None, "they are longer than what is there");
        assert_eq!(end(0, 1, 5), None, "a picture without pixels");
        assert_eq!(end(0, 0, 5), Some((5, 0)));
        assert_eq!(Components::split(&[0, 0]), None);
    }
}
