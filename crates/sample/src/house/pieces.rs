//! The furniture records of the house and where their pieces stand.

use std::f64::consts::FRAC_1_SQRT_2;

use super::layout;

/// A rotation about y as a quaternion in the data's order x, y, z, w.
pub(super) type Turn = [f64; 4];

/// Rotations by the direction that the front faces. A model's own front faces +z, which is south.
const SOUTH: Turn = [0.0, 0.0, 0.0, 1.0];
const EAST: Turn = [0.0, FRAC_1_SQRT_2, 0.0, FRAC_1_SQRT_2];
const NORTH: Turn = [0.0, 1.0, 0.0, 0.0];
const WEST: Turn = [0.0, -FRAC_1_SQRT_2, 0.0, FRAC_1_SQRT_2];

/// The key `valid` of a record of the `furniture` list.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Validity {
    /// `valid` is true.
    Valid,
    /// `valid` is false.
    Invalid,
    /// The key is absent.
    Absent,
}

/// A record of the `furniture` list.
#[derive(Clone, Copy, Debug)]
pub(super) struct Record {
    /// The record's id.
    pub(super) uid: &'static str,
    /// The model's name; some models are not in the library.
    pub(super) model: &'static str,
    pub(super) validity: Validity,
    /// As in "sofa/l-shaped sofa"; may be empty.
    pub(super) title: &'static str,
}

/// One placement of a record's model.
#[derive(Clone, Copy, Debug)]
pub(super) struct Piece {
    /// The record's id.
    pub(super) uid: &'static str,
    /// Index in [`layout::ROOMS`].
    pub(super) room: usize,
    /// Position in metres.
    pub(super) at: [f64; 3],
    pub(super) turn: Turn,
}

/// Heights of the lower ends of the pendant and the ceiling lamp, whose upper ends touch the ceiling.
const PENDANT_Y: f64 = layout::HEIGHT - 0.95;
const CEILING_LAMP_Y: f64 = layout::HEIGHT - 0.15;

const fn record(uid: &'static str, model: &'static str, title: &'static str) -> Record {
    Record { uid, model, validity: Validity::Valid, title }
}

/// Every record. The nightstand 2002 is placed twice.
pub(super) const RECORDS: [Record; 33] = [
    record("1001/model", "l_sofa", "sofa/l-shaped sofa"),
    record("1002/model", "coffee_table", "table/coffee table"),
    record("1003/model", "tv_stand", "cabinet/tv stand"),
    record("1004/model", "dining_table", "table/dining table"),
    record("1005/model", "dining_chair", "chair/dining chair"),
    record("1006/model", "dining_chair", "chair/dining chair"),
    record("1007/model", "dining_chair", "chair/dining chair"),
    record("1008/model", "dining_chair", ""),
    record("1009/model", "pendant_lamp", "lighting/pendant light"),
    record("1010/model", "floor_lamp", "lighting/floor lamp"),
    record("1011/model", "picture", "accessory/picture"),
    record("2001/model", "bed", "bed/double bed"),
    record("2002/model", "nightstand", "cabinet/nightstand"),
    record("2003/model", "wardrobe", "cabinet/wardrobe"),
    record("2004/model", "bed_end_stool", "stool/bed end stool"),
    record("2005/model", "ceiling_lamp", "lighting/ceiling light"),
    record("3001/model", "bookcase", "cabinet/bookcase"),
    record("3002/model", "chest", "cabinet/drawer chest"),
    record("3003/model", "shelf", "cabinet/shelf"),
    record("3004/model", "armchair", "sofa/armchair"),
    record("3005/model", "side_table", "table/side table"),
    record("3006/model", "lounge_chair", "chair/lounge chair"),
    record("3007/model", "stool", "stool/stool"),
    record("3008/model", "crate", "accessory/box"),
    record("3009/model", "crate", "accessory/box"),
    record("3010/model", "picture", "accessory/picture"),
    record("3011/model", "nightstand", "cabinet/nightstand"),
    record("3012/model", "vase that was lost", "accessory/vase"),
    Record { validity: Validity::Invalid, ..record("3013/model", "plant that is not public", "plants/plant") },
    Record { validity: Validity::Absent, ..record("3014/model", "door leaf that is not public", "door/door") },
    record("3015/model", "basket", "accessory/basket"),
    record("3016/model", "mat", "accessory/mat"),
    record("3017/model", "sculpture", "accessory/sculpture"),
];

const fn piece(uid: &'static str, room: usize, at: [f64; 3], turn: Turn) -> Piece {
    Piece { uid, room, at, turn }
}

/// Every placement, room by room.
pub(super) const PIECES: [Piece; 34] = [
    piece("1001/model", 0, [1.6, 0.0, 3.59], NORTH),
    piece("1002/model", 0, [1.75, 0.0, 2.35], SOUTH),
    piece("1003/model", 0, [1.75, 0.0, 0.25], SOUTH),
    piece("1004/model", 0, [4.4, 0.0, 1.6], SOUTH),
    piece("1005/model", 0, [4.0, 0.0, 0.85], SOUTH),
    piece("1006/model", 0, [4.8, 0.0, 0.85], SOUTH),
    piece("1007/model", 0, [4.0, 0.0, 2.35], NORTH),
    piece("1008/model", 0, [4.8, 0.0, 2.35], NORTH),
    piece("1009/model", 0, [4.4, PENDANT_Y, 1.6], SOUTH),
    piece("1010/model", 0, [3.15, 0.0, 4.05], SOUTH),
    piece("1011/model", 0, [0.025, 1.3, 1.9], EAST),
    piece("2001/model", 1, [8.1, 0.0, 1.125], SOUTH),
    piece("2002/model", 1, [6.8, 0.0, 0.25], SOUTH),
    piece("2002/model", 1, [9.4, 0.0, 0.25], SOUTH),
    piece("2003/model", 1, [8.6, 0.0, 4.07], NORTH),
    piece("2004/model", 1, [8.1, 0.0, 2.5], SOUTH),
    piece("2005/model", 1, [8.1, CEILING_LAMP_Y, 2.3], SOUTH),
    piece("3001/model", 2, [1.0, 0.0, 8.0], NORTH),
    piece("3002/model", 2, [2.45, 0.0, 7.94], NORTH),
    piece("3003/model", 2, [3.75, 0.0, 7.99], NORTH),
    piece("3004/model", 2, [0.85, 0.0, 5.3], SOUTH),
    piece("3005/model", 2, [1.9, 0.0, 5.1], SOUTH),
    piece("3006/model", 2, [2.9, 0.0, 5.1], SOUTH),
    piece("3007/model", 2, [4.0, 0.0, 5.1], SOUTH),
    piece("3008/model", 2, [4.7, 0.0, 7.3], SOUTH),
    piece("3009/model", 2, [5.25, 0.0, 7.5], SOUTH),
    piece("3010/model", 2, [5.575, 1.3, 6.2], WEST),
    piece("3011/model", 2, [3.0, 0.0, 6.4], SOUTH),
    piece("3012/model", 2, [2.2, 0.0, 6.4], SOUTH),
    piece("3013/model", 2, [5.2, 0.0, 5.9], SOUTH),
    piece("3014/model", 2, [5.05, 0.0, 4.5], NORTH),
    piece("3015/model", 2, [0.7, 0.0, 6.9], SOUTH),
    piece("3016/model", 2, [1.9, 0.0, 6.2], SOUTH),
    piece("3017/model", 2, [0.5, 0.0, 6.1], SOUTH),
];

/// The record with this id.
pub(super) fn record_of(uid: &str) -> &'static Record {
    RECORDS.iter().find(|record| record.uid == uid).expect("pieces name records of the list")
}
