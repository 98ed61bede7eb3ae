//! The round trip of a frame, measured: for every line of the input, `jpeg` or `rgb8`, one frame is
//! sent and its time from send to answer is printed, with what the server took of it, both in
//! milliseconds. `client/python/bench/round_trip.py` runs this beside the same in Python.
#![expect(clippy::print_stdout, reason = "a measurement shows its results")]

use anyhow::{Context, bail};
use clap::Parser;
use client::{Capture, Delivery, RobotClient, RobotOptions, protos::prost::bytes::Bytes, v1};
use std::{
    io::BufRead,
    path::PathBuf,
    time::{Duration, Instant},
};

/// Send one frame for each line of the input, and print how long its answer took.
#[derive(Parser)]
struct Arguments {
    /// The server's zenoh endpoint.
    #[arg(long)]
    endpoint: String,
    /// The robot's name.
    #[arg(long)]
    robot: String,
    /// The frame as JPEG.
    #[arg(long)]
    jpeg: PathBuf,
    /// The same frame as raw red, green and blue.
    #[arg(long)]
    rgb: PathBuf,
    /// Width and height of the frame, px.
    #[arg(long, num_args = 2, value_names = ["WIDTH_PX", "HEIGHT_PX"])]
    size: Vec<u32>,
}

#[tokio::main]
async fn main() -> Result<(), anyhow::Error> {
    let arguments = Arguments::parse();
    let size = (arguments.size[0], arguments.size[1]);
    let (jpeg, rgb) =
        (Bytes::from(std::fs::read(&arguments.jpeg)?), Bytes::from(std::fs::read(&arguments.rgb)?));
    let options = RobotOptions {
        delivery: Delivery::Every,
        ..RobotOptions::new(&arguments.endpoint, "default", &arguments.robot)
    };
    let robot = RobotClient::connect(&options).await?;
    for line in std::io::stdin().lock().lines() {
        let encoding = line?;
        let started = Instant::now();
        let capture = match encoding.as_str() {
            "jpeg" => Capture::encoded(jpeg.clone())?,
            "rgb8" => Capture::raw(v1::ImageEncoding::Rgb8, size, rgb.clone())?,
            other => bail!("{other}: jpeg or rgb8 is expected"),
        };
        let capture = capture.with_deadline_ms(60_000);
        let answer = robot.recognise("front", capture, Duration::from_secs(30)).await?;
        let elapsed_ms = 1e3 * started.elapsed().as_secs_f64();
        answer.rejection.as_ref().map_or(Ok(()), |r| bail!("{}", r.detail)).context("refused")?;
        println!("{elapsed_ms} {}", answer.latency_ms);
    }
    robot.close().await?;
    Ok(())
}
