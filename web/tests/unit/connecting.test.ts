// What is shown to connect a robot is what the guides say.
import { readFileSync } from "node:fs";
import { expect, test } from "vitest";
import { likelyEndpoint, waysOf } from "../../src/words/connecting";

const guide = (name: string) => readFileSync(`../docs/guides/${name}.md`, "utf8");
const textOf = (way: string, is_encrypted: boolean) => {
  const endpoint = `${is_encrypted ? "tls" : "tcp"}/127.0.0.1:7447`;
  const steps = waysOf({ robot: "r1", map: "office", endpoint, is_encrypted }).find(({ name }) => name === way)?.steps ?? [];
  return steps.map(({ text }) => text).join("\n");
};

test("the address is that of the pages, encrypted as they are", () => {
  expect(likelyEndpoint({ protocol: "http:", hostname: "localhost" })).toBe("tcp/127.0.0.1:7447");
  expect(likelyEndpoint({ protocol: "https:", hostname: "maps.example" })).toBe("tls/maps.example:7447");
});

test("programs and settings to copy are those of the guides", () => {
  const connect = 'RobotClient::connect(&RobotOptions::new("tcp/127.0.0.1:7447", "default", "r1"))';
  expect(textOf("rust", false)).toContain(connect);
  expect(guide("connect-a-robot")).toContain(connect);
  expect(textOf("python", false)).toContain('Robot.connect("r1", endpoint="tcp/127.0.0.1:7447")');
  expect(guide("python")).toContain('Robot.connect("r1", endpoint="tcp/127.0.0.1:7447")');
  for (const line of textOf("ros2", false).split("\n").filter((line) => line.includes(" = ") && !line.startsWith("domain"))) {
    expect(guide("ros2"), line).toContain(line.split("#")[0]?.trim());
  }
  for (const way of ["python", "rust"]) expect(textOf(way, true)).toContain("r1/robot.json");
  expect(textOf("rust", true)).toContain("waymark robot enrol r1 --out r1");
  expect(guide("deploy")).toContain("waymark robot enrol r1 --out r1");
});
