//! Four robots and a coordinator's router over TLS in full traffic: how many messages come, and whether the process lives.
//!
//! `cargo bench -p tests --bench tls [-- SECONDS]`. As it is, it may die within seconds (zenoh #2557); with what every program of Tender sees to,
//! `ZENOH_RUNTIME='(rx: (handover: tx))'`, it must not.

#![allow(clippy::disallowed_methods, reason = "it measures real time")]

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use anyhow::anyhow;
use coordinator::certs::{self, Day, Holder};
use node::{Link, NetworkConfig, Tls};
use proto::{RobotId, SiteId};

const ROBOTS: usize = 4;
const NOW: std::ops::Range<Day> = 20_000..40_000;

#[tokio::main]
async fn main() -> anyhow::Result<()> {
    let told = std::env::args().filter(|word| word != "--bench").nth(1);
    let lasts = Duration::from_secs(told.map_or(Ok(15), |word| word.parse())?);
    let (folder, site) = (tempfile::tempdir()?, SiteId::new("plant")?);
    let ca = folder.path().join("ca");
    certs::init(&ca, &site, NOW)?;
    let tls = |holder: Holder| -> anyhow::Result<Option<Tls>> {
        let files = certs::issue(&ca, &site, &holder, &[], NOW, folder.path())?;
        Ok(Some(Tls { ca: ca.join("ca.pem"), certificate: files.certificate, key: files.key }))
    };
    let address = format!("tls/localhost:{}", tests::free_port()?);
    let desk = Link::open(&NetworkConfig { tls: tls(Holder::Coordinator)?, ..NetworkConfig::on(&address) }, site.clone()).await?;
    let heard = Arc::new(AtomicU64::new(0));
    let counted = Arc::clone(&heard);
    let count = move |_| {
        counted.fetch_add(1, Ordering::Relaxed);
    };
    let _desk = desk.session.declare_subscriber("tender/plant/**").callback(count).await.map_err(|error| anyhow!("{error}"))?;
    let begun = Instant::now();
    let mut robots = Vec::new();
    for number in 0..ROBOTS {
        let holder = Holder::Robot(RobotId::new(format!("r-{number}"))?);
        let link = Link::open(&NetworkConfig { tls: tls(holder)?, ..NetworkConfig::to(&address) }, site.clone()).await?;
        robots.push(tokio::spawn(speak(link, number, begun, lasts)));
    }
    for robot in robots {
        robot.await??;
    }
    println!("{ROBOTS} robots, {:.0} messages/s heard", heard.load(Ordering::Relaxed) as f64 / begun.elapsed().as_secs_f64());
    Ok(())
}

/// Says messages of 0.3 to 3.3 kB as fast as they go, and hears those of all.
async fn speak(link: Link, number: usize, begun: Instant, lasts: Duration) -> anyhow::Result<()> {
    let _hears = link.session.declare_subscriber("tender/plant/**").callback(drop).await.map_err(|error| anyhow!("{error}"))?;
    for said in 0_usize.. {
        if begun.elapsed() >= lasts {
            break;
        }
        let message = vec![0_u8; 300 + said * 37 % 3000];
        link.session.put(format!("tender/plant/x/{number}"), message).await.map_err(|error| anyhow!("{error}"))?;
        if said % 20 == 19 {
            tokio::time::sleep(Duration::from_millis(1)).await;
        }
    }
    Ok(())
}
