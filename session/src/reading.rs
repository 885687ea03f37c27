//! How the volumes of a scene are read: what the scene's instances say, completed or replaced by what the caller says.
//!
//! ```text
//! instance.reading ─┐
//!                   ├─► OpenOptions, field by field the caller's first ─► the reader
//! the caller's ─────┘        └─► instance.reading of the scene that is drawn, saved, and held by its picture
//! ```
//! `pumice_scene::Reading` is the JSON form, `pumice_formats::OpenOptions` what the readers take.

use pumice_formats::{ArrayAxes, MissingChunks, OpenOptions, RawLayout, Recorded, Roi, Scale};
use pumice_scene::{AbsentChunks, AxisOrder, LevelOfFile, RawVoxels, Reading, Scene};

/// The options with which the source of an instance is opened: the caller's where it gives any, otherwise those of `instance`.
pub fn options_for(instance: &Reading, caller: &OpenOptions) -> OpenOptions {
    OpenOptions {
        layer: caller.layer.or(instance.layer),
        time: caller.time.or(instance.time),
        channel: caller.channel.or(instance.channel),
        array: caller.array.clone().or_else(|| instance.array.clone()),
        spacing: caller.spacing.or(instance.spacing),
        raw: caller.raw.clone().or_else(|| instance.raw.as_ref().map(layout_of)),
        // Both have the same names.
        axes: caller.axes.or(instance.axes.and_then(|axes| ArrayAxes::of_name(axes.name()))),
        scale: caller.scale.or(instance.scale.map(|level| match level {
            LevelOfFile::Number(number) => Scale::Level(number),
            LevelOfFile::Size(lengths) => Scale::Size(lengths),
        })),
        roi: caller.roi.or(instance.roi.map(Roi)),
        label: caller.label.clone().or_else(|| instance.label.clone()),
        dataset: caller.dataset.clone().or_else(|| instance.dataset.clone()),
        missing_chunks: caller.missing_chunks.or(instance.missing_chunks.map(|missing| match missing {
            AbsentChunks::Fill => MissingChunks::Fill,
            AbsentChunks::Error => MissingChunks::Error,
        })),
        relabel: caller.relabel.clone().or_else(|| instance.relabel.clone()),
        warnings: caller.warnings.clone(),
        outputs: caller.outputs.clone(),
        cancelled: caller.cancelled.clone(),
        recorded: Recorded {
            layer: caller.layer.is_none(),
            time: caller.time.is_none(),
            channel: caller.channel.is_none(),
        },
    }
}

fn layout_of(raw: &RawVoxels) -> RawLayout {
    let &RawVoxels { dims, label_type, big_endian, offset } = raw;
    RawLayout { dims, label_type, big_endian, offset }
}

/// What a scene records of the options with which a volume is opened.
pub fn recorded(options: &OpenOptions) -> Reading {
    // Taken apart by name, so that a new option cannot be forgotten here.
    let OpenOptions {
        layer,
        time,
        channel,
        array,
        spacing,
        raw,
        axes,
        scale,
        roi,
        label,
        dataset,
        missing_chunks,
        relabel,
        warnings: _,
        outputs: _,
        recorded: _,
        cancelled: _,
    } = options;
    Reading {
        layer: *layer,
        time: *time,
        channel: *channel,
        array: array.clone(),
        axes: axes.and_then(|axes| AxisOrder::ALL.into_iter().find(|order| order.name() == axes.name())),
        spacing: *spacing,
        raw: raw.as_ref().map(|raw| {
            let &RawLayout { dims, label_type, big_endian, offset } = raw;
            RawVoxels { dims, label_type, big_endian, offset }
        }),
        scale: scale.map(|scale| match scale {
            Scale::Level(number) => LevelOfFile::Number(number),
            Scale::Size(lengths) => LevelOfFile::Size(lengths),
        }),
        roi: roi.map(|roi| roi.0),
        label: label.clone(),
        dataset: dataset.clone(),
        missing_chunks: missing_chunks.map(|missing| match missing {
            MissingChunks::Fill => AbsentChunks::Fill,
            MissingChunks::Error => AbsentChunks::Error,
        }),
        // As the sources of a scene, so that it names the same file wherever it is used.
        relabel: relabel.as_ref().map(|table| std::path::absolute(table).unwrap_or_else(|_| table.clone())),
    }
}

/// Gives each instance the options with which its source was opened, so that the scene alone says them.
pub fn record(scene: &mut Scene, caller: &OpenOptions) {
    for instance in &mut scene.instances {
        instance.reading = recorded(&options_for(&instance.reading, caller));
    }
}

#[cfg(test)]
mod tests {
    #[test]
    fn orders_of_axes_have_the_same_names_in_scenes_and_readers() {
        use super::{ArrayAxes, AxisOrder};
        assert_eq!(ArrayAxes::ALL.map(ArrayAxes::name), AxisOrder::ALL.map(AxisOrder::name));
    }
    use super::*;

    fn all() -> OpenOptions {
        OpenOptions {
            layer: Some(1),
            time: Some(2),
            channel: Some(3),
            array: Some("cells".into()),
            spacing: Some([4.0, 5.0, 6.0]),
            raw: Some(RawLayout {
                dims: [7, 8, 9],
                label_type: pumice_core::LabelType::I16,
                big_endian: true,
                offset: 10,
            }),
            axes: Some(ArrayAxes::Zyx),
            scale: Some(Scale::Size([8.0, 8.0, 40.0])),
            roi: Some(Roi([[Some(1), None], [None, Some(9)], [None, None]])),
            label: Some("nuclei".into()),
            dataset: Some("volumes/labels".into()),
            missing_chunks: Some(MissingChunks::Error),
            relabel: Some("segments.csv".into()),
            ..OpenOptions::default()
        }
    }

    /// Every option is a field of its own: what is recorded names all of them again, and the caller's single option replaces only its own.
    #[test]
    fn every_option_comes_back_and_the_callers_come_first() {
        let said = recorded(&all());
        let back = options_for(&said, &OpenOptions::default());
        assert_eq!(back.given(), all().given());
        assert_eq!(recorded(&back), said);
        let other = OpenOptions { time: Some(0), axes: Some(ArrayAxes::Xyz), ..OpenOptions::default() };
        let expected = Reading { time: Some(0), axes: Some(AxisOrder::Xyz), ..said.clone() };
        assert_eq!(recorded(&options_for(&said, &other)), expected);
        assert_ne!(expected, said);
        assert!(recorded(&OpenOptions::default()).is_empty());
    }

    /// What a caller says himself is told from what a scene records, option by option.
    #[test]
    fn what_the_scene_records_is_told_from_what_the_caller_says() {
        let said = Reading { layer: Some(0), time: Some(0), ..Reading::default() };
        let caller = OpenOptions { time: Some(0), ..OpenOptions::default() };
        let together = options_for(&said, &caller).recorded;
        assert!(together.layer && !together.time);
        assert_eq!(caller.recorded, Recorded::default());
    }
}
