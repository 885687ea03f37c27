//! Flags of the figure that `pumice render` composes for a volume.

use clap::{Args, ValueEnum};
use pumice_session::figure::{
    AxisCut, Background, FigureFlags, FocusOn, FrameOn, LabelColor, LabelPreset, Opening, Selector, distance,
    view,
};

use super::selectors::{Selectors, all_but_ids, ids, selectors};

/// Names of these flags that have no effect on a picture that is made again.
pub(crate) const NOT_AGAIN: [&str; 15] = [
    "labels",
    "query",
    "pick",
    "color",
    "material",
    "background",
    "floor",
    "cut",
    "smooth",
    "focus",
    "aperture",
    "view",
    "distance",
    "frame",
    "turntable",
];

#[derive(Debug, Args)]
#[command(
    next_help_heading = "Figure of a volume (a scene says these itself, but for --labels, --query, --background and --smooth)"
)]
pub(crate) struct Figure {
    /// Draw only these labels: ids, names, queries, separated by commas
    ///
    /// Each is an id or a query line (see --query), such as 17,42,type:axon,"dark cell"; a word is part of a name. One that matches no
    /// label is refused. Ids alone are quickest: of a .pumice file, other labels are then not read
    #[arg(
        long,
        value_name = "A,B,C",
        value_parser = selectors,
        allow_hyphen_values = true,
        conflicts_with_all = ["pick", "query"]
    )]
    labels: Vec<Selectors>,
    /// Draw only the labels for which this holds, e.g. 'cortex voxels>1000'; the line of `pumice info --query`
    #[arg(long, value_name = "QUERY", value_parser = Selector::parse, allow_hyphen_values = true)]
    query: Option<Selector>,
    /// Draw only N labels that make a good figure, of all or of those of --query: long, thin ones first
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pick: Option<u32>,
    /// Colour of labels, as CSS has them: 17=#e0a030, type:axon=orange, 'voxels>1000=#333'; repeatable, later ones count
    ///
    /// On the left is an id or a query line (see --query), behind the last = a colour as on a screen. The brightest faces show it under the
    /// default light
    #[arg(long, value_name = "SELECTOR=COLOR", value_parser = LabelColor::parse, allow_hyphen_values = true)]
    color: Vec<LabelColor>,
    /// Material of all labels or, as SELECTOR=NAME, of some: plastic, metal, ghost, glass; repeatable, later ones count
    ///
    /// plastic (the default), metal. ghost: a thin veil without refraction, for context around opaque labels; twice the time of plastic for the
    /// same noise. glass: clear and refracting; 3.6 times. Choose ghost where many labels lie behind one another, and on a white
    /// background, which glass does not show
    #[arg(long, value_name = "NAME", value_parser = LabelPreset::parse, allow_hyphen_values = true)]
    material: Vec<LabelPreset>,
    /// Background: white, black, a colour such as #f4f1ea, or transparent; default: a light grey backdrop, or the scene's
    ///
    /// A PNG has exactly this colour where nothing is, in every view transform, and no alpha. An EXR keeps its alpha, so that it can be laid
    /// over any colour
    #[arg(long, value_name = "COLOR", value_parser = Background::parse, conflicts_with = "transparent")]
    background: Option<Background>,
    /// Let the shadows of what is shown fall on a floor just below it: an invisible plane, which the scene has as a built-in mesh
    #[arg(long)]
    floor: bool,
    /// Cut the volume open across an index axis; repeatable
    ///
    /// x=0.5 removes what lies beyond half of the volume's extent along x, -x=0.5 the other half. The fraction is above 0 and below 1. Labels
    /// show on the cut
    #[arg(long, value_name = "[-]AXIS=FRACTION", value_parser = AxisCut::parse, allow_hyphen_values = true)]
    cut: Vec<AxisCut>,
    /// Shade voxels smooth, by the direction in which their label falls off, instead of by their flat faces
    #[arg(long)]
    smooth: bool,
    /// Focus on labels (an id or a query), or at a distance along the view axis in world units, which has a point: 17 or 25.0
    ///
    /// A figure is 10 world units across. Default with --aperture: the middle of what is framed
    #[arg(long, value_name = "SELECTOR|DISTANCE", value_parser = FocusOn::parse, allow_hyphen_values = true)]
    focus: Option<FocusOn>,
    /// Opening of the lens: an f-number such as f/2.8, or a radius in world units; default with --focus: f/2.8
    ///
    /// F-numbers are those of a lens of 72 mm in front of a figure of 10 cm
    #[arg(long, value_name = "f/N|RADIUS", value_parser = Opening::parse)]
    aperture: Option<Opening>,
    /// Direction of the camera in degrees: around the vertical axis, then above the horizon; default 24,24
    ///
    /// 0,0 looks from the front; positive angles go counter-clockwise seen from above: 90,0 looks from the right, 180,0 from behind, -90,0 from
    /// the left, and 0,90 down from above. The key light comes from behind the camera's left shoulder and moves with it
    #[arg(long, value_name = "AROUND,ABOVE", value_parser = view, allow_hyphen_values = true)]
    view: Option<[f64; 2]>,
    /// Distance of the camera from the middle of what is framed, in world units; default: as close as everything is seen
    ///
    /// What is framed has a diagonal of 10 world units, so that 25 is usual
    #[arg(long, value_name = "DISTANCE", value_parser = distance)]
    distance: Option<f64>,
    /// What the camera frames: the labels that are shown, or the whole volume
    ///
    /// With volume, place, scale and camera do not depend on which labels are shown, so that pictures of several can be laid over one another.
    /// Default: labels
    #[arg(long, value_enum)]
    frame: Option<FrameArg>,
    /// Write N pictures from around the vertical axis: OUT_0001.png, OUT_0002.png, …
    ///
    /// The camera goes counter-clockwise seen from above, from --view on; distance, focus, light and colours stay. --save-scene writes the scene
    /// of the first picture
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..), conflicts_with = "explain")]
    turntable: Option<u32>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum FrameArg {
    Labels,
    Volume,
}

impl Figure {
    /// Number of pictures of a turntable, if it is one.
    pub(crate) fn turntable(&self) -> Option<u32> {
        self.turntable
    }

    /// Labels by id, where nothing but ids is named.
    pub(crate) fn ids(&self) -> Option<Vec<u64>> {
        ids(&self.labels)
    }

    /// The flags as a session takes them, without the labels of [`Figure::ids`].
    pub(crate) fn flags(&self) -> FigureFlags {
        FigureFlags {
            labels: all_but_ids(&self.labels),
            query: self.query.clone(),
            pick: self.pick.map(|n| n as usize),
            color: self.color.clone(),
            material: self.material.clone(),
            cut: self.cut.clone(),
            floor: self.floor,
            view: self.view,
            distance: self.distance,
            frame: self.frame.map(|frame| match frame {
                FrameArg::Labels => FrameOn::Labels,
                FrameArg::Volume => FrameOn::Volume,
            }),
            turntable: self.turntable,
            focus: self.focus.clone(),
            aperture: self.aperture,
            background: self.background,
            smooth: self.smooth,
            ..FigureFlags::default()
        }
    }
}
