// Commands that record what a robot and the server say to one another, and replay it.

export interface Recording {
  record: string;
  replay: string;
  compare: string;
}

/** The name under which a recording is played: the robot itself may be driving. */
const PLAYER = "replay";

/** The commands for a robot on a map, and the address of the server. */
export function recordingOf(robot: string, map: string, server: string): Recording {
  const file = `${robot}.mcap`;
  const at = `--server ${server}`;
  const replay = `waymark replay ${file} --robot ${PLAYER} --map ${map} ${at}`;
  return { record: `waymark record ${file} --robot ${robot} ${at}`, replay, compare: `${replay} --compare` };
}
