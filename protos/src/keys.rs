//! Keys under `waymark/1/{fleet}/`, built from checked names and parsed back into them. The
//! transport does not tell a handler who sent a message, so the robot's name is in every key that a
//! robot writes.
//!
//! On the wire every key of a robot is one of a fixed list: access control names each, and needs no
//! wildcard, which would let keys of any length pass. So the camera is not in the key expression:
//! it is the attachment of the message.

use std::fmt;

/// Version of the protocol, second chunk of every key.
pub const PROTOCOL: &str = "1";
/// First chunk of every key.
pub const ROOT: &str = "waymark";
/// Longest name, in bytes.
pub const MAX_NAME_BYTES: usize = 64;
/// Liveliness tokens that a robot may have: the slot of an epoch is its remainder by this number.
pub const ALIVE_SLOTS: u8 = 16;

/// Why a text is not a name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum NameError {
    /// Empty, or longer than [`MAX_NAME_BYTES`].
    #[error("a name has 1 to {MAX_NAME_BYTES} characters, this one has {0}")]
    Length(usize),
    /// A character outside the set.
    #[error("a name has lower-case letters, digits, `-` and `_`; character {} is none of them", .0 + 1)]
    Character(usize),
}

/// The name of a fleet, robot, camera, map or landmark: `[a-z0-9_-]{1,64}`. Safe in keys, addresses
/// and file names.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash, serde::Serialize, serde::Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Name(String);

impl Name {
    /// Checks a text.
    pub fn new(text: impl Into<String>) -> Result<Self, NameError> {
        let text = text.into();
        if text.is_empty() || text.len() > MAX_NAME_BYTES {
            return Err(NameError::Length(text.len()));
        }
        match text.bytes().position(|b| !matches!(b, b'a'..=b'z' | b'0'..=b'9' | b'_' | b'-')) {
            Some(position) => Err(NameError::Character(position)),
            None => Ok(Self(text)),
        }
    }

    /// The name as text.
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl fmt::Display for Name {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl AsRef<str> for Name {
    fn as_ref(&self) -> &str {
        &self.0
    }
}

impl std::borrow::Borrow<str> for Name {
    fn borrow(&self) -> &str {
        &self.0
    }
}

impl TryFrom<String> for Name {
    type Error = NameError;
    fn try_from(text: String) -> Result<Self, NameError> {
        Self::new(text)
    }
}

impl std::str::FromStr for Name {
    type Err = NameError;
    fn from_str(text: &str) -> Result<Self, NameError> {
        Self::new(text)
    }
}

impl From<Name> for String {
    fn from(name: Name) -> Self {
        name.0
    }
}

/// What a key says, without the fleet.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub enum Key {
    /// `robot/{robot}/frame/{camera}`: robot to server, `Frame`. On the wire `robot/{robot}/frame`,
    /// the camera attached.
    Frame(Name, Name),
    /// `robot/{robot}/quads/{camera}`: robot to server, `Quads`. The camera is attached.
    Quads(Name, Name),
    /// `robot/{robot}/answer/{camera}`: server to robot, `Answer`. The camera is attached.
    Answer(Name, Name),
    /// `robot/{robot}/odometry`: robot to server, `Odometry`.
    Odometry(Name),
    /// `robot/{robot}/scan`: robot to server, `Scan`.
    Scan(Name),
    /// `robot/{robot}/pose`: server to robot, `RobotPose`.
    Pose(Name),
    /// `robot/{robot}/alive/{slot}`: liveliness token of a start of a robot's software;
    /// [`alive_slot`] of its epoch, in decimal digits.
    Alive(Name, u8),
    /// `robot/{robot}/rpc/gaze`: a query of the robot, `GazeRequest` in, `GazeAdvice` out.
    Gaze(Name),
    /// `robot/{robot}/rpc/hello`: a query of the robot, answered with nothing: its messages arrive.
    Hello(Name),
    /// `robot/{robot}/rpc/localise`: a query of the robot, `LocaliseRequest` in, `LocaliseReply`
    /// out.
    Localise(Name),
    /// `map/{map}/changed`: server to all, `MapChanged`.
    MapChanged(Name),
    /// `map/{map}/version`: a query of anyone, `MapChanged` out with the present version.
    MapVersion(Name),
    /// `server/{server}/...`: liveliness token of a server.
    Server(Name, ServerToken),
}

/// What a server announces of itself by a liveliness token below `server/{server}/`.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum ServerToken {
    /// `alive/{start}`: it lives; a random number of its start, in decimal digits.
    Alive(u64),
    /// `holds/{map}`: it has the map, and serves it unless another server does.
    Holds(Name),
    /// `serves/{map}`: it answers robots on the map.
    Serves(Name),
    /// `robot/{robot}`: the robot is registered with it.
    Robot(Name),
}

/// Why a key expression is not one of the protocol.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum KeyError {
    /// Another root, protocol version or fleet.
    #[error("the key does not begin with {0}")]
    Prefix(String),
    /// No key has this shape.
    #[error("no key of the protocol has this shape")]
    Shape,
    /// A chunk is not a name.
    #[error("{chunk}: {error}")]
    Name {
        /// Which chunk: `robot`, `camera`, `map` or `server`.
        chunk: &'static str,
        /// What is wrong with it.
        error: NameError,
    },
}

/// Builds and parses the keys of one fleet.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Keys {
    prefix: String,
}

impl Keys {
    /// Keys under `waymark/1/{fleet}/`.
    pub fn new(fleet: &Name) -> Self {
        Self { prefix: format!("{ROOT}/{PROTOCOL}/{fleet}/") }
    }

    /// The key expression on the wire, and the name of the camera that is attached to the message.
    pub fn on_wire<'a>(&self, key: &'a Key) -> (String, Option<&'a str>) {
        let p = &self.prefix;
        match key {
            Key::Frame(robot, camera) => (format!("{p}robot/{robot}/frame"), Some(camera.as_str())),
            Key::Quads(robot, camera) => (format!("{p}robot/{robot}/quads"), Some(camera.as_str())),
            Key::Answer(robot, camera) => (self.answers_of(robot), Some(camera.as_str())),
            other => (self.build(other), None),
        }
    }

    /// The key of a message: its key expression, and what is attached. Total, as [`Self::parse`].
    pub fn received(&self, expression: &str, attachment: Option<&[u8]>) -> Result<Key, KeyError> {
        let mut chunks = expression.strip_prefix(&self.prefix).unwrap_or_default().split('/');
        let shape = [chunks.next(), chunks.next(), chunks.next(), chunks.next()];
        let [Some("robot"), Some(_), Some("frame" | "quads" | "answer"), None] = shape else {
            return self.parse(expression);
        };
        // Longer ones are no names: they are not copied.
        let camera = attachment.filter(|camera| camera.len() <= MAX_NAME_BYTES).unwrap_or_default();
        self.parse(&format!("{expression}/{}", String::from_utf8_lossy(camera)))
    }

    /// The full key. Frames, quads and answers have their camera in it: so they are called in
    /// recordings.
    pub fn build(&self, key: &Key) -> String {
        let p = &self.prefix;
        match key {
            Key::Frame(robot, camera) => format!("{p}robot/{robot}/frame/{camera}"),
            Key::Quads(robot, camera) => format!("{p}robot/{robot}/quads/{camera}"),
            Key::Answer(robot, camera) => format!("{p}robot/{robot}/answer/{camera}"),
            Key::Odometry(robot) => format!("{p}robot/{robot}/odometry"),
            Key::Scan(robot) => format!("{p}robot/{robot}/scan"),
            Key::Pose(robot) => format!("{p}robot/{robot}/pose"),
            Key::Alive(robot, slot) => format!("{p}robot/{robot}/alive/{slot}"),
            Key::Gaze(robot) => format!("{p}robot/{robot}/rpc/gaze"),
            Key::Hello(robot) => format!("{p}robot/{robot}/rpc/hello"),
            Key::Localise(robot) => format!("{p}robot/{robot}/rpc/localise"),
            Key::MapChanged(map) => format!("{p}map/{map}/changed"),
            Key::MapVersion(map) => format!("{p}map/{map}/version"),
            Key::Server(server, token) => match token {
                ServerToken::Alive(start) => format!("{p}server/{server}/alive/{start}"),
                ServerToken::Holds(map) => format!("{p}server/{server}/holds/{map}"),
                ServerToken::Serves(map) => format!("{p}server/{server}/serves/{map}"),
                ServerToken::Robot(robot) => format!("{p}server/{server}/robot/{robot}"),
            },
        }
    }

    /// Key expression of the frames of all robots.
    pub fn all_frames(&self) -> String {
        format!("{}robot/*/frame", self.prefix)
    }

    /// Key expression of the quads of all robots.
    pub fn all_quads(&self) -> String {
        format!("{}robot/*/quads", self.prefix)
    }

    /// Key expression of the odometry of all robots.
    pub fn all_odometry(&self) -> String {
        format!("{}robot/*/odometry", self.prefix)
    }

    /// Key expression of the laser scans of all robots.
    pub fn all_scans(&self) -> String {
        format!("{}robot/*/scan", self.prefix)
    }

    /// Key expression of the gaze requests of all robots.
    pub fn all_gaze(&self) -> String {
        format!("{}robot/*/rpc/gaze", self.prefix)
    }

    /// Key expression of the localisations of all robots.
    pub fn all_localisations(&self) -> String {
        format!("{}robot/*/rpc/localise", self.prefix)
    }

    /// Key expression of the greetings of all robots.
    pub fn all_hellos(&self) -> String {
        format!("{}robot/*/rpc/hello", self.prefix)
    }

    /// Key of a server's question to itself: `server/{id}/ping`, with the id of its zenoh session.
    pub fn ping(&self, id: &str) -> String {
        format!("{}server/{id}/ping", self.prefix)
    }

    /// Key expression of the versions of all maps.
    pub fn all_map_versions(&self) -> String {
        format!("{}map/*/version", self.prefix)
    }

    /// Key expression of all liveliness tokens.
    pub fn all_alive(&self) -> String {
        format!("{}robot/*/alive/*", self.prefix)
    }

    /// Key expression of all answers for all robots.
    pub fn all_answers(&self) -> String {
        format!("{}robot/*/answer", self.prefix)
    }

    /// Key expression of the fused poses of all robots.
    pub fn all_poses(&self) -> String {
        format!("{}robot/*/pose", self.prefix)
    }

    /// Key expression of the changes of all maps.
    pub fn all_map_changes(&self) -> String {
        format!("{}map/*/changed", self.prefix)
    }

    /// Key expression of everything that servers announce.
    pub fn all_server_tokens(&self) -> String {
        format!("{}server/*/*/*", self.prefix)
    }

    /// Key expression of the servers that live.
    pub fn all_servers(&self) -> String {
        format!("{}server/*/alive/*", self.prefix)
    }

    /// Key expression of the maps that servers serve.
    pub fn all_served_maps(&self) -> String {
        format!("{}server/*/serves/*", self.prefix)
    }

    /// Key expression of the servers where a robot is registered.
    pub fn servers_of(&self, robot: &Name) -> String {
        format!("{}server/*/robot/{robot}", self.prefix)
    }

    /// Key expressions of everything that one robot puts.
    pub fn puts_of(&self, robot: &Name) -> [String; 4] {
        ["frame", "quads", "odometry", "scan"].map(|kind| format!("{}robot/{robot}/{kind}", self.prefix))
    }

    /// Keys of all liveliness tokens of one robot.
    pub fn tokens_of(&self, robot: &Name) -> Vec<String> {
        (0..ALIVE_SLOTS).map(|slot| self.build(&Key::Alive(robot.clone(), slot))).collect()
    }

    /// Key expression of all answers for one robot.
    pub fn answers_of(&self, robot: &Name) -> String {
        format!("{}robot/{robot}/answer", self.prefix)
    }

    /// Parses a full key, as [`Self::build`] gives it. Total: any text gives a key or an error.
    pub fn parse(&self, text: &str) -> Result<Key, KeyError> {
        let rest = text.strip_prefix(&self.prefix).ok_or_else(|| KeyError::Prefix(self.prefix.clone()))?;
        let named = |chunk: &'static str, text: &str| {
            Name::new(text).map_err(|error| KeyError::Name { chunk, error })
        };
        let robot = |text| named("robot", text);
        let mut chunks = rest.split('/');
        let shape = [chunks.next(), chunks.next(), chunks.next(), chunks.next(), chunks.next()];
        match shape {
            [Some("robot"), Some(r), Some("frame"), Some(c), None] => {
                Ok(Key::Frame(robot(r)?, named("camera", c)?))
            }
            [Some("robot"), Some(r), Some("quads"), Some(c), None] => {
                Ok(Key::Quads(robot(r)?, named("camera", c)?))
            }
            [Some("robot"), Some(r), Some("answer"), Some(c), None] => {
                Ok(Key::Answer(robot(r)?, named("camera", c)?))
            }
            [Some("robot"), Some(r), Some("rpc"), Some("gaze"), None] => Ok(Key::Gaze(robot(r)?)),
            [Some("robot"), Some(r), Some("rpc"), Some("hello"), None] => Ok(Key::Hello(robot(r)?)),
            [Some("robot"), Some(r), Some("rpc"), Some("localise"), None] => Ok(Key::Localise(robot(r)?)),
            [Some("robot"), Some(r), Some("odometry"), None, _] => Ok(Key::Odometry(robot(r)?)),
            [Some("robot"), Some(r), Some("scan"), None, _] => Ok(Key::Scan(robot(r)?)),
            [Some("robot"), Some(r), Some("pose"), None, _] => Ok(Key::Pose(robot(r)?)),
            [Some("robot"), Some(r), Some("alive"), Some(slot), None] => {
                let slot = u8::try_from(number(slot)?).ok().filter(|slot| *slot < ALIVE_SLOTS);
                Ok(Key::Alive(robot(r)?, slot.ok_or(KeyError::Shape)?))
            }
            [Some("map"), Some(m), Some("changed"), None, _] => Ok(Key::MapChanged(named("map", m)?)),
            [Some("map"), Some(m), Some("version"), None, _] => Ok(Key::MapVersion(named("map", m)?)),
            [Some("server"), Some(s), Some(kind), Some(of), None] => {
                let server = named("server", s)?;
                let token = match kind {
                    "alive" => ServerToken::Alive(number(of)?),
                    "holds" => ServerToken::Holds(named("map", of)?),
                    "serves" => ServerToken::Serves(named("map", of)?),
                    "robot" => ServerToken::Robot(robot(of)?),
                    _ => return Err(KeyError::Shape),
                };
                Ok(Key::Server(server, token))
            }
            _ => Err(KeyError::Shape),
        }
    }
}

/// The slot of an epoch among a robot's liveliness tokens.
pub fn alive_slot(epoch: u64) -> u8 {
    (epoch % u64::from(ALIVE_SLOTS)) as u8
}

/// A number as [`Keys::build`] writes it: no sign, no leading zero.
fn number(text: &str) -> Result<u64, KeyError> {
    let number: u64 = text.parse().map_err(|_not_a_number| KeyError::Shape)?;
    if number.to_string() == text { Ok(number) } else { Err(KeyError::Shape) }
}

#[cfg(test)]
mod tests;
