// What each page is for, in a sentence, and the guide that says more. The server serves the guides of docs/guides.

/** `guide` is the name of a file, and of a section in it where one is about this page alone. */
export interface Help {
  what: string;
  guide: string;
}

/** By the pattern of the address, with the part for pages that have parts. */
export const HELP: Readonly<Record<string, Help>> = {
  "/": { what: "All maps and robots at a glance, and what needs somebody.", guide: "administrator#a-map" },
  "/maps/:map": { what: "One floor from above with its robots: look, measure, trace walls, place landmarks.", guide: "administrator#a-map" },
  "/maps/:map/landmarks": { what: "All landmarks of the map, what was learnt of each, and which look alike.", guide: "administrator#landmarks" },
  "/maps/:map/landmarks/:landmark": { what: "Whether robots use this landmark, why not if they do not, and how it is changed.", guide: "administrator#landmarks" },
  "/maps/:map/landmarks/:landmark/sheet": { what: "A sheet for whoever hangs this landmark or checks it.", guide: "administrator#landmarks" },
  "/maps/:map/sheet": { what: "The floor on paper, its landmarks by number.", guide: "administrator#a-map" },
  "/maps/:map/settings?part=where": { what: "Where this floor lies in another map, so that a robot may change floors.", guide: "administrator#settings-of-a-map" },
  "/maps/:map/settings?part=camera": { what: "The camera that coverage is computed for.", guide: "administrator#settings-of-a-map" },
  "/maps/:map/settings?part=gates": { what: "What a landmark must show before robots use it: views, points, and sides from which it was photographed.", guide: "administrator#settings-of-a-map" },
  "/maps/:map/settings?part=fusion": { what: "Which of landmarks, laser and odometry counts, and in which area.", guide: "administrator#settings-of-a-map" },
  "/maps/:map/settings?part=scans": { what: "Walls of the laser scans of a robot that is driven round. They are shown before they replace any.", guide: "administrator#settings-of-a-map" },
  "/maps/:map/teach": { what: "Teaches a landmark by photographs, and tries it.", guide: "administrator#teaching" },
  "/maps/:map/gather": { what: "Collects candidates for landmarks while a robot drives past.", guide: "administrator#collecting-while-driving" },
  "/maps/:map/history": { what: "Every change with its author; any of them can be taken back.", guide: "history" },
  "/maps/:map/drafts/:draft": { what: "A copy of the map to teach and edit without any robot noticing, until it is published.", guide: "administrator#history-and-drafts" },
  "/robots": { what: "All robots: connected or not, where they are, and why a message was refused.", guide: "administrator#robots" },
  "/robots/:robot": { what: "One robot: how it is connected, what it sees, and what its position rests on.", guide: "connect-a-robot" },
  "/answers": { what: "What robots were told lately, and why one got no position.", guide: "administrator#why-a-robot-said-no" },
  "/answers/:answer": { what: "What one answer rests on: each outline, what it was compared with, and every check.", guide: "troubleshooting" },
  "/admin?part=health": { what: "What is wrong with this server, and what to do about it.", guide: "administrator#the-server" },
  "/admin?part=events": { what: "What happens on this server, as it happens.", guide: "administrator#the-server" },
  "/admin?part=jobs": { what: "Lessons and other long work: what runs, and what failed.", guide: "administrator#the-server" },
  "/admin?part=tokens": { what: "Who may do what: a token for each person and each program.", guide: "administrator#the-server" },
  "/admin?part=audit": { what: "Who changed what, in a log that shows where it was tampered with.", guide: "audit-log" },
  "/admin?part=backups": { what: "Copies of everything, made by the clock or now, and how one is restored.", guide: "backup" },
  "/help": { what: "All guides that this server has.", guide: "administrator" },
  "/help/:guide": { what: "A guide of this server.", guide: "administrator" },
};

export interface Guide {
  name: string;
  title: string;
  what: string;
}

/** All guides, by what somebody wants. A test compares them with docs/guides. */
export const GUIDES: readonly { title: string; guides: readonly Guide[] }[] = [
  {
    title: "Begin",
    guides: [
      { name: "first-pose", title: "First pose", what: "From nothing to the first position of a robot." },
      { name: "administrator", title: "The pages for administrators", what: "What every page is for." },
      { name: "survey-a-building", title: "Survey a building", what: "Walls and landmarks of one drive." },
      { name: "teach-a-map", title: "Teach a map", what: "Landmarks and walls of a whole floor." },
      { name: "import-a-map", title: "Import a map", what: "Walls of a ROS grid, a vector map, or a plan." },
    ],
  },
  {
    title: "Robots",
    guides: [
      { name: "connect-a-robot", title: "Connect a robot", what: "Frames, odometry and scans; what comes back." },
      { name: "ros2", title: "Robots of ROS 2", what: "Topics in, a pose and a transform out." },
      { name: "python", title: "Python", what: "The package, with examples." },
      { name: "calibrate-a-camera", title: "Calibrate a camera", what: "Intrinsics of landmarks that it has seen." },
      { name: "record-replay", title: "Record a drive, look at it, replay it", what: "A file of what a robot does." },
      { name: "evaluate-on-your-photographs", title: "Evaluate on your photographs", what: "How well it works in your building." },
    ],
  },
  {
    title: "When something is wrong",
    guides: [
      { name: "troubleshooting", title: "Troubleshooting", what: "What is seen, why, and what to do." },
      { name: "history", title: "Take a change back", what: "Undo, earlier states, drafts." },
      { name: "audit-log", title: "See who changed what", what: "The audit log and its check." },
    ],
  },
  {
    title: "Run a server",
    guides: [
      { name: "deploy", title: "Deploy a server", what: "Service, container, certificates, disk." },
      { name: "backup", title: "Back up and restore", what: "Made by the clock, checked, restored." },
      { name: "monitor", title: "Monitor a server", what: "Readiness, metrics, log, traces." },
      { name: "log-events", title: "Log events", what: "Each event of the log, and what follows." },
      { name: "several-servers", title: "Several servers", what: "A map here, a map there, one network." },
      { name: "move-a-map", title: "Move a map to another server", what: "Export, import, and the robots." },
      { name: "command-line", title: "The command line", what: "All that the pages do, in scripts." },
    ],
  },
  {
    title: "Reference",
    guides: [
      { name: "TERMS", title: "Terms", what: "Words, frames, units." },
      { name: "API", title: "The HTTP API", what: "Resources, errors, limits." },
      { name: "AUTHORISATION", title: "Who may do what", what: "The role that each operation needs." },
      { name: "OPERATIONS", title: "What the server promises", what: "And the tests that prove it." },
      { name: "BUNDLE", title: "The file of a map", what: "What an export holds." },
      { name: "EVALUATION", title: "Evaluation", what: "How figures are measured." },
    ],
  },
];

export const guideOf = (name: string): Guide | undefined => GUIDES.flatMap(({ guides }) => guides).find((guide) => guide.name === name);
