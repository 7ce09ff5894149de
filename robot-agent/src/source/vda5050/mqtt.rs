//! An MQTT broker: a vehicle's messages into a queue, ours out.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use anyhow::{Context, ensure};
use rumqttc::{AsyncClient, Event, MqttOptions, Packet, Publish, QoS};
use serde::Serialize;
use tokio::sync::mpsc;
use tracing::{info, warn};

use super::Config;

/// Port of a broker when nothing is said.
const PORT: u16 = 1883;
/// Largest message either way, bytes: a state message lists nodes and edges.
const MESSAGE_MAX: usize = 1 << 20;
/// Messages that wait for the next look at them; more are dropped.
const QUEUE: usize = 256;
/// Between two tries to reach the broker.
const RETRY: Duration = Duration::from_secs(1);

/// A message with its topic.
type Message = (String, Vec<u8>);

/// A broker, or the attempt to reach one.
pub(super) struct Broker {
    client: AsyncClient,
    messages: mpsc::Receiver<Message>,
    status: Arc<Mutex<String>>,
    connected: Arc<AtomicBool>,
}

/// Host and port of a broker's address.
///
/// # Errors
/// Says how it is written.
pub(super) fn address(broker: &str) -> anyhow::Result<(String, u16)> {
    let wrong = || format!("source.broker = \"{broker}\": must be mqtt://HOST or mqtt://HOST:PORT");
    let rest = broker.strip_prefix("mqtt://").with_context(wrong)?;
    let (host, port) = match rest.rsplit_once(':') {
        Some((host, port)) => (host, port.parse().ok().with_context(wrong)?),
        None => (rest, PORT),
    };
    ensure!(!host.is_empty() && !host.contains('/'), "{}", wrong());
    Ok((host.to_owned(), port))
}

/// What has come, if it says something of now. A broker may keep a vehicle's last state for whoever asks later, however old it is; of a
/// connection it keeps what is so, as the standard wants it.
fn of_now(publish: Publish) -> Option<Message> {
    let is_old = publish.retain && publish.topic.ends_with("/state");
    (!is_old).then(|| (publish.topic, publish.payload.to_vec()))
}

impl Broker {
    /// Connects to the broker in the background, and goes on trying.
    pub(super) fn connect(config: &Config, client_id: &str) -> anyhow::Result<Self> {
        let (host, port) = address(&config.broker)?;
        let mut options = MqttOptions::new(client_id, host, port);
        options.set_max_packet_size(MESSAGE_MAX, MESSAGE_MAX);
        if let Some(username) = &config.username {
            options.set_credentials(username, config.password.as_deref().unwrap_or_default());
        }
        let (client, mut events) = AsyncClient::new(options, QUEUE);
        let (messages_in, messages) = mpsc::channel(QUEUE);
        let status = Arc::new(Mutex::new(format!("{} does not answer yet", config.broker)));
        let say = {
            let status = Arc::clone(&status);
            move |what: String| *status.lock().unwrap_or_else(PoisonError::into_inner) = what
        };
        // In this order: whether the vehicle is there is known before it is heard.
        let topics = [config.topic("connection")?, config.topic("state")?];
        let (broker, ours) = (config.broker.clone(), client.clone());
        let connected = Arc::new(AtomicBool::new(false));
        let is_connected = Arc::clone(&connected);
        tokio::spawn(async move {
            while !messages_in.is_closed() {
                match events.poll().await {
                    // A broker forgets who listened when the link breaks: every time anew.
                    Ok(Event::Incoming(Packet::ConnAck(_))) => {
                        info!("connected to {broker}");
                        for topic in &topics {
                            if let Err(error) = ours.try_subscribe(topic, QoS::AtMostOnce) {
                                warn!("{topic}: {error}");
                            }
                        }
                        say(format!("no message under {}", topics[1]));
                        is_connected.store(true, Ordering::Relaxed);
                    }
                    Ok(Event::Incoming(Packet::Publish(publish))) => {
                        if let Some(message) = of_now(publish) {
                            let _ = messages_in.try_send(message);
                        }
                    }
                    Ok(_) => {}
                    Err(error) => {
                        is_connected.store(false, Ordering::Relaxed);
                        say(format!("{broker}: {error}"));
                        tokio::time::sleep(RETRY).await;
                    }
                }
            }
        });
        Ok(Self { client, messages, status, connected })
    }

    /// One that is never reached.
    #[cfg(test)]
    pub(super) fn unreached() -> Self {
        let (client, _) = AsyncClient::new(MqttOptions::new("tender-test", "127.0.0.1", PORT), QUEUE);
        let (status, connected) = (Arc::new(Mutex::new(String::new())), Arc::new(AtomicBool::new(false)));
        Self { client, messages: mpsc::channel(QUEUE).1, status, connected }
    }

    /// The next message that has come.
    pub(super) fn next(&mut self) -> Option<Message> {
        self.messages.try_recv().ok()
    }

    /// How it stands with the connection, for people.
    pub(super) fn status(&self) -> String {
        self.status.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Whether the broker is there. What is sent meanwhile would wait, and leave no room for what makes us hear again.
    pub(super) fn is_connected(&self) -> bool {
        self.connected.load(Ordering::Relaxed)
    }

    /// Sends a message, once, as the standard wants it for everything but `connection`.
    pub(super) fn publish(&self, topic: &str, message: &impl Serialize) -> anyhow::Result<()> {
        Ok(self.client.try_publish(topic, QoS::AtMostOnce, false, serde_json::to_vec(message)?)?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_state_that_the_broker_has_kept_is_not_one_of_now() {
        let comes = |topic: &str, retain: bool| of_now(Publish { retain, ..Publish::new(topic, QoS::AtMostOnce, "{}") }).is_some();
        assert!(comes("uagv/v2/KIT/0001/state", false));
        assert!(!comes("uagv/v2/KIT/0001/state", true));
        assert!(comes("uagv/v2/KIT/0001/connection", true));
    }

    #[test]
    fn an_address_has_a_host_and_perhaps_a_port() {
        assert_eq!(address("mqtt://broker.site").unwrap(), ("broker.site".to_owned(), 1883));
        assert_eq!(address("mqtt://10.0.0.1:11883").unwrap(), ("10.0.0.1".to_owned(), 11883));
        for wrong in ["broker", "mqtts://broker", "mqtt://", "mqtt://broker:x", "mqtt://broker/x"] {
            assert!(address(wrong).unwrap_err().to_string().contains("must be mqtt://HOST or mqtt://HOST:PORT"), "{wrong}");
        }
    }
}
