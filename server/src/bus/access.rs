//! Who may do what on the encrypted listener, as access control of zenoh. In: certificates, robots
//! with their maps, prefixes of robots of ROS 2. Out: rules by which a robot writes its own keys
//! alone, and reads its own answers and its maps' changes. What no rule allows is dropped.
//!
//! zenoh knows of a certificate nothing but its name, which the front makes the robot's. It reads
//! the rules once, when a session opens: [`super::gate`] opens it again when they change.

use crate::config::Ros2Robot;
use engine::snapshot::Snapshots;
use protos::{Key, Keys, Name};
use serde_json::{Value, json};
use std::collections::{BTreeMap, BTreeSet};

/// Every kind of message that zenoh's access control knows.
const ALL_MESSAGES: [&str; 9] = [
    "put",
    "delete",
    "declare_subscriber",
    "query",
    "reply",
    "declare_queryable",
    "liveliness_token",
    "liveliness_query",
    "declare_liveliness_subscriber",
];
/// Every key: wildcards do not stand for parts that begin with `@`, which ROS 2 uses.
const ALL_KEYS: [&str; 4] = ["**", "@ros2_lv/**", "**/@ros2_lv/**", "**/@adv/**"];
/// The server's own link among the subjects.
const SERVER: &str = "server";
/// Kind of the link between the two routers of the server. Robots have others.
const SERVER_LINK: &str = "unixsock-stream";

/// What one robot is known by, and may.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Grant {
    /// Names in its certificates.
    common_names: BTreeSet<String>,
    /// Its map, and those linked with it.
    maps: BTreeSet<String>,
    /// Where its messages of ROS 2 are.
    ros2_prefix: Option<String>,
}

/// What all robots may.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub(super) struct Policy {
    robots: BTreeMap<Name, Grant>,
}

impl Policy {
    /// What registered robots may, of those that have certificates; the front connects each under
    /// its name. `by_name`: all may have one of the operator's own authority.
    pub(super) fn new(holders: &[String], snapshots: &Snapshots, ros2: &[Ros2Robot], by_name: bool) -> Self {
        let registered = snapshots.robots();
        let mut linked = BTreeMap::<&str, BTreeSet<String>>::new();
        let mut robots = BTreeMap::new();
        for (robot, map) in &registered {
            let Ok(name) = Name::new(robot.as_str()) else { continue };
            if !by_name && !holders.contains(robot) {
                continue;
            }
            let maps = linked.entry(map).or_insert_with(|| linked_with(snapshots, map)).clone();
            let of_ros2 = ros2.iter().find(|of_ros2| of_ros2.robot == name);
            let ros2_prefix = of_ros2.and_then(Ros2Robot::own_prefix).map(str::to_owned);
            robots.insert(name, Grant { common_names: [robot.clone()].into(), maps, ros2_prefix });
        }
        Self { robots }
    }

    /// As zenoh's settings want it, for the router that the server's own one reaches by a socket.
    pub(super) fn access_control_of_gate(&self, keys: &Keys) -> Value {
        self.access_control(keys, &json!({ "id": SERVER, "link_protocols": [SERVER_LINK] }))
    }

    fn access_control(&self, keys: &Keys, server: &Value) -> Value {
        let mut rules = vec![rule(SERVER, &ALL_KEYS, &ALL_MESSAGES, &["ingress", "egress"])];
        let mut subjects = vec![server.clone()];
        let mut policies = vec![json!({ "rules": [SERVER], "subjects": [SERVER] })];
        rules.extend(shared(keys));
        for (robot, grant) in &self.robots {
            let own = of_robot(keys, robot, grant);
            let mut ids: Vec<Value> = own.iter().map(|rule| rule["id"].clone()).collect();
            ids.extend(["inputs", "questions", "watch servers", "servers"].map(Value::from));
            rules.extend(own);
            // Names of robots are not subjects of their own: one may be called as the server's.
            let subject = format!("robot {robot}");
            subjects.push(json!({ "id": subject, "cert_common_names": grant.common_names }));
            policies.push(json!({ "rules": ids, "subjects": [subject] }));
        }
        json!({
            "enabled": true,
            "default_permission": "deny",
            "rules": rules,
            "subjects": subjects,
            "policies": policies,
        })
    }
}

/// The same for a router of the operator that servers join: each robot is known by the common names
/// of its certificates, and hears changes of `maps`.
pub fn access_control_for_router(
    fleet: &Name,
    robots: &BTreeMap<Name, BTreeSet<String>>,
    maps: &BTreeSet<String>,
    servers: &[String],
) -> Value {
    let grant = |common_names: &BTreeSet<String>| Grant {
        common_names: common_names.clone(),
        maps: maps.clone(),
        ros2_prefix: None,
    };
    let robots = robots.iter().map(|(robot, names)| (robot.clone(), grant(names))).collect();
    Policy { robots }
        .access_control(&Keys::new(fleet), &json!({ "id": SERVER, "cert_common_names": servers }))
}

/// The map itself, and every map that lies in the same coordinates.
fn linked_with(snapshots: &Snapshots, map: &str) -> BTreeSet<String> {
    let others = snapshots.all().into_iter().filter(|other| !other.is_draft).map(|other| other.name.clone());
    let mut maps: BTreeSet<String> =
        others.filter(|other| snapshots.relation(map, other).is_some()).collect();
    maps.insert(map.to_owned());
    maps
}

fn rule(id: &str, keys: &[impl AsRef<str>], messages: &[&str], flows: &[&str]) -> Value {
    let keys: Vec<&str> = keys.iter().map(AsRef::as_ref).collect();
    json!({ "id": id, "permission": "allow", "flows": flows, "messages": messages, "key_exprs": keys })
}

/// What each robot may: learn that the server listens, and know which servers live.
fn shared(keys: &Keys) -> [Value; 4] {
    let inputs = [keys.all_frames(), keys.all_quads(), keys.all_odometry(), keys.all_scans()];
    let questions = [keys.all_gaze(), keys.all_hellos(), keys.all_localisations(), keys.all_map_versions()];
    let servers = [keys.all_server_tokens()];
    [
        rule("inputs", &inputs, &["declare_subscriber"], &["egress"]),
        rule("questions", &questions, &["declare_queryable"], &["egress"]),
        rule("watch servers", &servers, &["declare_liveliness_subscriber", "liveliness_query"], &["ingress"]),
        rule("servers", &servers, &["liveliness_token"], &["egress"]),
    ]
}

/// What a robot may by its name. What it sends and asks for has no wildcards: they would let keys
/// of any length pass, and zenoh panics where it forwards one of more than 65 535 bytes.
fn of_robot(keys: &Keys, robot: &Name, grant: &Grant) -> Vec<Value> {
    let key = |key: &Key| keys.build(key);
    let id = |what: &str| format!("{robot} {what}");
    let read = [keys.answers_of(robot), key(&Key::Pose(robot.clone()))];
    let asked = [Key::Gaze(robot.clone()), Key::Hello(robot.clone()), Key::Localise(robot.clone())];
    let asked = asked.map(|asked| key(&asked));
    let mut rules = vec![
        rule(&id("writes"), &keys.puts_of(robot), &["put"], &["ingress"]),
        rule(&id("lives"), &keys.tokens_of(robot), &["liveliness_token"], &["ingress"]),
        rule(&id("asks"), &asked, &["query"], &["ingress"]),
        rule(&id("is answered"), &asked, &["reply"], &["egress"]),
        rule(&id("listens"), &read, &["declare_subscriber"], &["ingress"]),
        rule(&id("reads"), &read, &["put"], &["egress"]),
    ];
    let maps: Vec<Name> = grant.maps.iter().filter_map(|map| Name::new(map.as_str()).ok()).collect();
    let changes: Vec<String> = maps.iter().map(|map| key(&Key::MapChanged(map.clone()))).collect();
    let versions: Vec<String> = maps.iter().map(|map| key(&Key::MapVersion(map.clone()))).collect();
    rules.push(rule(&id("listens to maps"), &changes, &["declare_subscriber"], &["ingress"]));
    rules.push(rule(&id("asks for versions"), &versions, &["query"], &["ingress"]));
    rules.push(rule(&id("reads maps"), &changes, &["put"], &["egress"]));
    rules.push(rule(&id("reads versions"), &versions, &["reply"], &["egress"]));
    if let Some(prefix) = &grant.ros2_prefix {
        let inside = ALL_KEYS.map(|key| format!("{prefix}/{key}"));
        rules.push(rule(&id("speaks ROS"), &inside, &ALL_MESSAGES, &["ingress", "egress"]));
    }
    rules
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_router_of_the_operator_gives_each_robot_its_own_keys() {
        let name = |text: &str| Name::new(text).unwrap();
        let robots = BTreeMap::from([(name("r1"), BTreeSet::from(["r1".to_owned()]))]);
        let maps = BTreeSet::from(["hall".to_owned()]);
        let servers = ["a".to_owned(), "b".to_owned()];
        let block = access_control_for_router(&name("site"), &robots, &maps, &servers);
        assert_eq!(block["default_permission"], "deny");
        assert_eq!(block["subjects"][0]["cert_common_names"], json!(["a", "b"]));
        assert_eq!(block["subjects"][1]["cert_common_names"], json!(["r1"]));
        let rules = block["rules"].as_array().unwrap();
        let of = |id: &str| rules.iter().find(|rule| rule["id"] == id).unwrap();
        assert_eq!(of("servers")["messages"], json!(["liveliness_token"]));
        assert_eq!(of("r1 reads maps")["key_exprs"], json!(["waymark/1/site/map/hall/changed"]));
        // zenoh understands it.
        let config = json!({ "mode": "router", "access_control": block });
        zenoh::Config::from_json5(&config.to_string()).unwrap();
    }
}
