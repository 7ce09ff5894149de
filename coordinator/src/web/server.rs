//! The routes.

use std::convert::Infallible;
use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use anyhow::Context as _;
use axum::Router;
use axum::body::to_bytes;
use axum::extract::{Path, Query, Request, State};
use axum::http::{HeaderValue, StatusCode, header};
use axum::middleware::{Next, from_fn, from_fn_with_state};
use axum::response::sse::{Event, KeepAlive, Sse};
use axum::response::{IntoResponse, Response};
use axum::routing::{delete, get, post};
use futures_util::Stream;
use proto::{PackId, RobotId, StationId};
use serde::Deserialize;
use tokio::net::TcpListener;

use super::desk::{Answer, Desk, NoAnswer, Question};
use super::view::Wanted;
use super::{WebConfig, assets, metrics};

/// Time between two pages of a live view.
const BEAT: Duration = Duration::from_secs(1);
/// Live views at a time.
const LIVE_MAX: usize = 64;
/// Events that are given when nothing is said, and at most.
const EVENTS: usize = 100;

/// Nothing but the server's own files may be loaded, and no page may frame this one.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; connect-src 'self'; img-src 'self' data:; \
                      base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

#[derive(Clone)]
struct Web {
    desk: Desk,
    token: Option<Arc<str>>,
    live: Arc<AtomicUsize>,
}

/// Listens where the configuration says.
///
/// # Errors
/// When the address cannot be listened on.
pub async fn bind(config: &WebConfig) -> anyhow::Result<TcpListener> {
    let wanted = SocketAddr::new(config.address, config.port);
    TcpListener::bind(wanted).await.with_context(|| format!("the dashboard cannot listen on {wanted} (web.address, web.port)"))
}

/// Serves until the task is dropped.
///
/// # Errors
/// When the socket fails.
pub async fn serve(listener: TcpListener, config: &WebConfig, desk: Desk) -> anyhow::Result<()> {
    let own = if config.address.is_ipv6() { format!("[{}]", config.address) } else { config.address.to_string() };
    let local = config.address.is_loopback().then_some(own);
    let web = Web { desk, token: config.token.as_deref().map(Arc::from), live: Arc::default() };
    let changes = Router::new()
        .route("/replan", post(|web| tell(web, Question::Replan)))
        .route("/robot/{robot}", delete(|web, Path(robot): Path<RobotId>| tell(web, Question::Forget(robot))))
        .route_layer(from_fn_with_state(web.clone(), with_token));
    let api = Router::new()
        .route("/", get(index))
        .route("/schedule", get(|web| tell(web, Question::Schedule)))
        .route("/capacity", get(|web| tell(web, Question::Capacity)))
        .route("/fleet", get(|web| tell(web, Question::Fleet)))
        .route("/events", get(events))
        .route("/explain/{robot}", get(|web, Path(robot): Path<RobotId>| tell(web, Question::Explain(robot))))
        .route("/view", get(|web, Query(wanted): Query<Wanted>| tell(web, Question::View(wanted))))
        .route("/view/robot/{robot}", get(|web, Path(robot): Path<RobotId>| tell(web, Question::Robot(robot))))
        .route(
            "/view/pack/{station}/{pack}",
            get(|web, Path((station, pack)): Path<(StationId, PackId)>| tell(web, Question::Pack(station, pack))),
        )
        .route("/live", get(live))
        .merge(changes);
    let file = |kind: &'static str, text: &'static str| get(move || async move { ([(header::CONTENT_TYPE, kind)], text) });
    let router = Router::new()
        .route("/", get(|State(web): State<Web>| async move { axum::response::Html(assets::live_page(web.token.is_some())) }))
        .route("/style.css", file("text/css; charset=utf-8", assets::CSS))
        .route("/script.js", file("text/javascript; charset=utf-8", assets::JS))
        .route("/icon.svg", file("image/svg+xml", assets::ICON))
        .route("/metrics", get(metrics_page))
        .route("/healthz", get(|State(web): State<Web>| async move { web.desk.ask(Question::Health).await.map_err(refusal) }))
        .route("/api/v1/", get(index))
        .nest("/api/v1", api)
        .fallback(|| async { refusal(NoAnswer::Unknown("there is no such page; see /api/v1/".to_owned())) })
        .layer(from_fn(in_json))
        .layer(from_fn(guarded))
        .layer(from_fn(move |request, next| known_host(local.clone(), request, next)))
        .with_state(web);
    axum::serve(listener, router).await.context("the dashboard has stopped")
}

async fn tell(State(web): State<Web>, question: Question) -> Response {
    as_json(web.desk.ask(question).await)
}

fn as_json(answer: Answer) -> Response {
    match answer {
        Ok(json) => ([(header::CONTENT_TYPE, "application/json")], json).into_response(),
        Err(why) => refusal(why),
    }
}

fn refusal(why: NoAnswer) -> Response {
    match why {
        NoAnswer::Unknown(what) => error(StatusCode::NOT_FOUND, &what),
        NoAnswer::Conflict(what) => error(StatusCode::CONFLICT, &what),
        NoAnswer::Busy => error(StatusCode::SERVICE_UNAVAILABLE, "the coordinator does not answer; ask again"),
    }
}

fn error(status: StatusCode, what: &str) -> Response {
    (status, axum::Json(serde_json::json!({ "error": what }))).into_response()
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Last {
    #[serde(default)]
    last: Option<usize>,
}

async fn events(web: State<Web>, Query(Last { last }): Query<Last>) -> Response {
    tell(web, Question::Events(last.unwrap_or(EVENTS))).await
}

async fn metrics_page(State(web): State<Web>) -> Response {
    match web.desk.ask(Question::Metrics).await {
        Ok(text) => ([(header::CONTENT_TYPE, metrics::CONTENT_TYPE)], text).into_response(),
        Err(why) => refusal(why),
    }
}

async fn index() -> Response {
    let routes = [
        ("GET /api/v1/schedule", "the plan in force (tender.schedule/1)"),
        ("GET /api/v1/capacity", "how many robots each pack can still service (tender.capacity/1)"),
        ("GET /api/v1/explain/ROBOT", "why a robot is serviced as it is (tender.explanation/1)"),
        ("GET /api/v1/fleet", "the newest gauge and state of every robot, pack and station"),
        ("GET /api/v1/events?last=N", "what happened last, newest first (tender.event/1)"),
        ("GET /api/v1/view?find=TEXT&sort=name|urgency&rows=N", "everything the page shows, numbers with sigma and text"),
        ("GET /api/v1/view/robot/ROBOT", "one robot in full"),
        ("GET /api/v1/view/pack/STATION/PACK", "energy of a pack over time"),
        ("GET /api/v1/live", "the view every second, as server-sent events; takes find, sort, rows"),
        ("POST /api/v1/replan", "makes a new plan; needs Authorization: Bearer TOKEN (web.token)"),
        ("DELETE /api/v1/robot/ROBOT", "forgets a lost robot that is gone for good; needs the same"),
    ];
    let routes: Vec<_> = routes.iter().map(|(route, what)| serde_json::json!({ "route": route, "what": what })).collect();
    axum::Json(serde_json::json!({ "version": env!("CARGO_PKG_VERSION"), "routes": routes })).into_response()
}

/// Counts a live view for as long as it lasts.
struct Watching(Arc<AtomicUsize>);

impl Drop for Watching {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::Relaxed);
    }
}

async fn live(State(web): State<Web>, Query(wanted): Query<Wanted>) -> Response {
    if web.live.fetch_add(1, Ordering::Relaxed) >= LIVE_MAX {
        web.live.fetch_sub(1, Ordering::Relaxed);
        return error(StatusCode::SERVICE_UNAVAILABLE, "too many live views are open");
    }
    let watching = Watching(Arc::clone(&web.live));
    Sse::new(pages(web.desk, wanted, watching)).keep_alive(KeepAlive::default()).into_response()
}

/// The page again and again; `view` events carry it, `busy` ones say that there is none now.
fn pages(desk: Desk, wanted: Wanted, watching: Watching) -> impl Stream<Item = Result<Event, Infallible>> {
    let beats = tokio::time::interval(BEAT);
    futures_util::stream::unfold((desk, wanted, watching, beats), |(desk, wanted, watching, mut beats)| async move {
        beats.tick().await;
        // Whoever led here does so no more: the page asks again, and finds who does.
        if desk.is_closed() {
            return None;
        }
        let event = match desk.ask(Question::View(wanted.clone())).await {
            Ok(view) => Event::default().event("view").data(view),
            Err(_) => Event::default().event("busy").data("the coordinator does not answer"),
        };
        Some((Ok(event), (desk, wanted, watching, beats)))
    })
}

/// What changes something needs the configured token.
async fn with_token(State(web): State<Web>, request: Request, next: Next) -> Response {
    let Some(token) = &web.token else {
        return error(StatusCode::FORBIDDEN, "nothing can be changed here: no token is configured (web.token)");
    };
    let given =
        request.headers().get(header::AUTHORIZATION).and_then(|value| value.to_str().ok()).and_then(|value| value.strip_prefix("Bearer "));
    if given.is_some_and(|given| same(given.as_bytes(), token.as_bytes())) {
        return next.run(request).await;
    }
    let refused = error(StatusCode::UNAUTHORIZED, "this needs the header Authorization: Bearer TOKEN, with the token of web.token");
    ([(header::WWW_AUTHENTICATE, "Bearer")], refused).into_response()
}

/// Takes as long for a wrong text as for the right one of its length.
fn same(a: &[u8], b: &[u8]) -> bool {
    a.len() == b.len() && a.iter().zip(b).fold(0, |difference, (a, b)| difference | (a ^ b)) == 0
}

/// A page of elsewhere whose name was made to point at this machine must not read this one.
async fn known_host(local: Option<String>, request: Request, next: Next) -> Response {
    let host = request.headers().get(header::HOST).and_then(|host| host.to_str().ok()).unwrap_or_default();
    let name = host.rsplit_once(':').map_or(host, |(name, port)| if port.ends_with(']') { host } else { name });
    if let Some(own) = local {
        // Names of hosts are the same in capitals.
        let known = ["localhost", "127.0.0.1", "[::1]", &own];
        if !known.iter().any(|known| known.eq_ignore_ascii_case(name)) {
            return error(StatusCode::FORBIDDEN, "this server answers to localhost only; set web.address to serve others");
        }
    }
    next.run(request).await
}

/// Longest text of a refusal.
const REFUSAL_MAX: usize = 4096;

/// What the framework refuses by itself (a query, an id, a method) is told as everything else is.
async fn in_json(request: Request, next: Next) -> Response {
    let response = next.run(request).await;
    let told = response.headers().get(header::CONTENT_TYPE).is_some_and(|kind| kind == "application/json");
    if told || !response.status().is_client_error() {
        return response;
    }
    let (parts, body) = response.into_parts();
    let allowed = parts.headers.get(header::ALLOW).cloned();
    let text = to_bytes(body, REFUSAL_MAX).await.unwrap_or_default();
    let text = String::from_utf8_lossy(&text);
    let what = match allowed.as_ref().and_then(|methods| methods.to_str().ok()) {
        Some(methods) => format!("this route takes {methods}"),
        None if text.is_empty() => parts.status.to_string(),
        None => text.into_owned(),
    };
    let mut response = error(parts.status, &what);
    if let Some(methods) = allowed {
        response.headers_mut().insert(header::ALLOW, methods);
    }
    response
}

async fn guarded(request: Request, next: Next) -> Response {
    let mut response = next.run(request).await;
    let headers = response.headers_mut();
    headers.insert(header::CONTENT_SECURITY_POLICY, HeaderValue::from_static(POLICY));
    headers.insert(header::X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff"));
    headers.insert(header::REFERRER_POLICY, HeaderValue::from_static("no-referrer"));
    headers.insert(header::CACHE_CONTROL, HeaderValue::from_static("no-store"));
    response
}

#[cfg(test)]
mod tests {
    use super::same;

    #[test]
    fn a_token_is_the_whole_token() {
        assert!(same(b"secret", b"secret"));
        for wrong in ["", "secre", "secret ", "Secret", "secrets"] {
            assert!(!same(wrong.as_bytes(), b"secret"), "{wrong}");
        }
    }
}
