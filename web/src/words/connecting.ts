// How a robot's program connects: ready to copy, for the ways that docs/guides/connect-a-robot.md describes.

/** What a robot's program needs to know. */
export interface RobotAddress {
  robot: string;
  map: string;
  /** The server's address for robots, such as `tcp/maps.example:7447`. */
  endpoint: string;
  /** Connections are encrypted: the robot has a folder with its certificate. */
  is_encrypted: boolean;
}

export interface Way {
  name: string;
  title: string;
  steps: { what: string; text: string }[];
}

/** The port that `waymark serve` takes for robots by default. */
const PORT = 7447;

/** The likely address for robots of a server whose pages are at this one. */
export const likelyEndpoint = ({ protocol, hostname }: { protocol: string; hostname: string }): string =>
  `${protocol === "https:" ? "tls" : "tcp"}/${hostname === "localhost" ? "127.0.0.1" : hostname}:${PORT}`;

export function waysOf({ robot, map, endpoint, is_encrypted }: RobotAddress): Way[] {
  const folder = `${robot}/robot.json`;
  const enrol = is_encrypted
    ? [{ what: "On the server's machine: make the robot's key and certificate, and bring the folder to the robot as a secret", text: `waymark robot enrol ${robot} --out ${robot}` }]
    : [];
  const rust = is_encrypted ? `RobotOptions::from_file("${folder}")?` : `RobotOptions::new("${endpoint}", "default", "${robot}")`;
  const python = is_encrypted ? `Robot.from_file("${folder}")` : `Robot.connect("${robot}", endpoint="${endpoint}")`;
  const settings = `[[ros2.robot]]
robot = "${robot}"
domain = 0                     # its ROS_DOMAIN_ID
base_frame = "base_footprint"
scan = "/scan"
odometry = "/odom"

[[ros2.robot.camera]]
name = "front"
image = "/camera/image_raw/compressed"
camera_info = "/camera/camera_info"`;
  return [
    {
      name: "python",
      title: "Python",
      steps: [
        { what: "Install the package, from a clone of the repository", text: "python3 -m pip install './client/python[numpy,jpeg]'" },
        ...enrol,
        {
          what: `Send a photograph of something that ${map} knows`,
          text: `from waymark import Image, Robot, named_landmarks

with ${python} as robot:
    answer = robot.recognise("front", Image.file("photo.jpg"), wait_s=30)
    print(answer.status, [named.name for named in named_landmarks(answer)])`,
        },
      ],
    },
    {
      name: "rust",
      title: "Rust",
      steps: [
        ...enrol,
        {
          what: "Try the smallest program, from a clone of the repository",
          text: is_encrypted
            ? `cargo run -p client --example 01_recognise -- --robot-file ${folder} photo.jpg`
            : `cargo run -p client --example 01_recognise -- --endpoint ${endpoint} --robot ${robot} photo.jpg`,
        },
        { what: "In a program of your own, with the crate client", text: `let robot = RobotClient::connect(&${rust}).await?;` },
      ],
    },
    {
      name: "ros2",
      title: "ROS 2",
      steps: [
        { what: "Add to waymark.toml of the server, with your topics, and start it again", text: settings },
        ...enrol,
        {
          what: "On the robot: its router connects to the server",
          text: `ZENOH_CONFIG_OVERRIDE='connect/endpoints=["${endpoint}"]' ros2 run rmw_zenoh_cpp rmw_zenohd`,
        },
      ],
    },
  ];
}
