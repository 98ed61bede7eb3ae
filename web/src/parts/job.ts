// Follows a job to its end.
import { get, path } from "../api/client";
import type { Job } from "../api/types";

/** Time between two looks, ms. */
const LOOK_MS = 400;

export async function follow(id: number, tell: (job: Job) => void): Promise<Job> {
  for (;;) {
    const job = await get(path("/jobs/{job}", { job: id }));
    if (job.state !== "queued" && job.state !== "running") return job;
    tell(job);
    await new Promise((then) => setTimeout(then, LOOK_MS));
  }
}
