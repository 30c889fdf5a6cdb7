//! The error for JSON that is not that of a house.

/// Why JSON is not that of a 3D-FRONT house, or exceeds a limit.
#[derive(Debug, thiserror::Error)]
pub enum HouseError {
    /// The text is not JSON.
    #[error("expected JSON: {reason}{hint}")]
    NotJson {
        /// The parser's reason.
        reason: serde_json::Error,
        /// What the file is instead, and what to do; empty where that is not known.
        hint: String,
    },
    /// The JSON is not an object.
    #[error("expected an object, found {found}")]
    NotAnObject {
        /// The kind of value.
        found: &'static str,
    },
    /// The JSON holds more values than any file of the data.
    #[error(
        "expected at most {most_values} values and {most_containers} lists and objects, found {values} and {containers}"
    )]
    TooLarge {
        /// Values in the JSON, about.
        values: usize,
        /// Lists and objects in the JSON.
        containers: usize,
        /// The most values allowed.
        most_values: usize,
        /// The most lists and objects allowed.
        most_containers: usize,
    },
    /// The key `scene` is missing or not an object.
    #[error("expected an object 'scene' with rooms, found none")]
    NoScene,
    /// The house has too many rooms.
    #[error("/scene/room: expected at most {most} rooms, found {found}")]
    TooManyRooms {
        /// The most rooms allowed.
        most: usize,
        /// Rooms of the house.
        found: usize,
    },
    /// The rooms have too many children.
    #[error("{place}: expected at most {most} children in all rooms together, found more")]
    TooManyChildren {
        /// JSON pointer to the room at which the limit is exceeded.
        place: String,
        /// The most children allowed.
        most: usize,
    },
    /// The meshes have too many triangles.
    #[error("{place}: expected at most {most} triangles in all meshes together, found more")]
    TooManyTriangles {
        /// JSON pointer to the mesh at which the limit is exceeded.
        place: String,
        /// The most triangles allowed.
        most: usize,
    },
}
