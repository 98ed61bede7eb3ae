//! The authorisation table: what each operation of the HTTP interface needs. An operation without a
//! row is refused, and fails a test. `docs/AUTHORISATION.md` is made of it.

use super::Principal;
use protos::api::Role::{self, Admin, Operator, Robot, Teacher, Viewer};
use std::{collections::HashMap, sync::LazyLock};

/// What a request must be allowed to see besides the role.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Scope {
    /// Nothing: it is about the principal itself, or shows only what the principal may see.
    Own,
    /// The map of the path.
    Map,
    /// The map on which the robot of the path stands.
    Robot,
    /// The map of the job of the path.
    Job,
    /// The map of the stored answer of the path.
    Answer,
    /// What is above maps: a token for all maps is needed.
    Server,
}

/// Who may ask for an operation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Access {
    /// Everybody, without credentials.
    Open,
    /// Principals of this role or a greater one, within this scope.
    Needs(Role, Scope),
}

/// A row of the table.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Rule {
    pub(crate) method: &'static str,
    /// Below `/api/v1`, as in the OpenAPI document.
    pub(crate) path: &'static str,
    pub(crate) access: Access,
}

const fn open(method: &'static str, path: &'static str) -> Rule {
    Rule { method, path, access: Access::Open }
}

const fn own(method: &'static str, path: &'static str, role: Role) -> Rule {
    Rule { method, path, access: Access::Needs(role, Scope::Own) }
}

const fn map(method: &'static str, path: &'static str, role: Role) -> Rule {
    Rule { method, path, access: Access::Needs(role, Scope::Map) }
}

const fn robot(method: &'static str, path: &'static str, role: Role) -> Rule {
    Rule { method, path, access: Access::Needs(role, Scope::Robot) }
}

const fn job(method: &'static str, path: &'static str, role: Role) -> Rule {
    Rule { method, path, access: Access::Needs(role, Scope::Job) }
}

const fn answer(method: &'static str, path: &'static str, role: Role) -> Rule {
    Rule { method, path, access: Access::Needs(role, Scope::Answer) }
}

const fn server(method: &'static str, path: &'static str, role: Role) -> Rule {
    Rule { method, path, access: Access::Needs(role, Scope::Server) }
}

/// Every operation.
pub(crate) const TABLE: &[Rule] = &[
    open("GET", "/healthz"),
    open("GET", "/readyz"),
    open("GET", "/version"),
    // It tells of all robots and maps at once.
    server("GET", "/metrics", Viewer),
    own("GET", "/whoami", Viewer),
    own("POST", "/session/links", Viewer),
    server("GET", "/tokens", Admin),
    server("POST", "/tokens", Admin),
    server("DELETE", "/tokens/{token}", Admin),
    server("GET", "/audit", Admin),
    server("GET", "/audit/check", Admin),
    server("GET", "/servers", Viewer),
    server("GET", "/backups", Admin),
    server("POST", "/backups", Admin),
    server("GET", "/backups/{backup}", Admin),
    server("DELETE", "/backups/{backup}", Admin),
    server("GET", "/backups/{backup}/file", Admin),
    own("GET", "/maps", Viewer),
    server("POST", "/maps", Operator),
    map("GET", "/maps/{map}", Viewer),
    map("PATCH", "/maps/{map}", Operator),
    map("DELETE", "/maps/{map}", Admin),
    server("POST", "/maps/{map}/copies", Operator),
    // All photographs of a place at once, with what surrounds the landmarks, and much work: more
    // than looking at one.
    map("GET", "/maps/{map}/bundle", Teacher),
    server("POST", "/bundles", Operator),
    map("GET", "/maps/{map}/transform", Viewer),
    own("GET", "/sites/{site}/topology", Viewer),
    map("GET", "/maps/{map}/walls", Viewer),
    map("PUT", "/maps/{map}/walls", Teacher),
    map("POST", "/maps/{map}/walls/read", Teacher),
    map("GET", "/maps/{map}/underlay", Viewer),
    map("PUT", "/maps/{map}/underlay", Teacher),
    map("DELETE", "/maps/{map}/underlay", Teacher),
    map("GET", "/maps/{map}/underlay/image", Viewer),
    map("GET", "/maps/{map}/commits", Viewer),
    map("GET", "/maps/{map}/commits/{commit}", Viewer),
    map("POST", "/maps/{map}/commits/{commit}/undo", Operator),
    map("GET", "/maps/{map}/difference", Viewer),
    map("POST", "/maps/{map}/rollback", Operator),
    map("GET", "/maps/{map}/drafts", Viewer),
    map("POST", "/maps/{map}/drafts", Teacher),
    map("DELETE", "/maps/{map}/drafts/{draft}", Teacher),
    map("GET", "/maps/{map}/drafts/{draft}/difference", Viewer),
    map("POST", "/maps/{map}/drafts/{draft}/publish", Operator),
    map("POST", "/maps/{map}/drafts/{draft}/replay", Teacher),
    map("GET", "/maps/{map}/mapping", Viewer),
    map("POST", "/maps/{map}/mapping", Teacher),
    map("DELETE", "/maps/{map}/mapping", Teacher),
    map("POST", "/maps/{map}/mapping/finish", Teacher),
    map("GET", "/maps/{map}/visibility-settings", Viewer),
    map("PUT", "/maps/{map}/visibility-settings", Operator),
    map("GET", "/maps/{map}/landmarks", Viewer),
    map("POST", "/maps/{map}/landmarks", Teacher),
    map("POST", "/maps/{map}/bulk/create-landmarks", Teacher),
    map("POST", "/maps/{map}/bulk/delete-landmarks", Teacher),
    map("GET", "/maps/{map}/landmarks/{landmark}", Viewer),
    map("PATCH", "/maps/{map}/landmarks/{landmark}", Teacher),
    map("DELETE", "/maps/{map}/landmarks/{landmark}", Teacher),
    map("POST", "/maps/{map}/landmarks/{landmark}/merge", Teacher),
    map("GET", "/maps/{map}/landmarks/{landmark}/evidence", Viewer),
    map("GET", "/maps/{map}/landmarks/{landmark}/model", Viewer),
    map("GET", "/maps/{map}/landmarks/{landmark}/distances", Viewer),
    map("GET", "/maps/{map}/landmarks/{landmark}/icon", Viewer),
    map("GET", "/maps/{map}/duplicates", Viewer),
    map("GET", "/maps/{map}/landmarks/{landmark}/views", Viewer),
    map("POST", "/maps/{map}/landmarks/{landmark}/views", Teacher),
    map("DELETE", "/maps/{map}/landmarks/{landmark}/views/{view}", Teacher),
    map("GET", "/maps/{map}/landmarks/{landmark}/refused-views", Viewer),
    map("GET", "/maps/{map}/landmarks/{landmark}/refused-views/{refused}/icon", Viewer),
    map("GET", "/maps/{map}/landmarks/{landmark}/views/{view}/icon", Viewer),
    map("GET", "/maps/{map}/landmarks/{landmark}/views/{view}/image", Viewer),
    map("POST", "/maps/{map}/landmarks/{landmark}/learn", Teacher),
    map("POST", "/maps/{map}/learn", Teacher),
    map("GET", "/maps/{map}/landmarks/{landmark}/visibility", Viewer),
    map("POST", "/maps/{map}/visible", Viewer),
    map("POST", "/maps/{map}/coverage", Viewer),
    map("POST", "/maps/{map}/gaze", Viewer),
    map("POST", "/maps/{map}/recognise", Robot),
    map("POST", "/maps/{map}/localise", Robot),
    map("GET", "/maps/{map}/modalities", Viewer),
    map("PUT", "/maps/{map}/modalities", Operator),
    map("GET", "/maps/{map}/modalities/at", Viewer),
    map("GET", "/maps/{map}/reference-runs", Viewer),
    map("DELETE", "/maps/{map}/reference-runs/{run}", Operator),
    map("GET", "/maps/{map}/gatherings", Viewer),
    map("POST", "/maps/{map}/gatherings", Teacher),
    map("GET", "/maps/{map}/gatherings/{gathering}", Viewer),
    map("DELETE", "/maps/{map}/gatherings/{gathering}", Teacher),
    map("POST", "/maps/{map}/gatherings/{gathering}/stop", Teacher),
    map("GET", "/maps/{map}/gatherings/{gathering}/tracks", Viewer),
    map("DELETE", "/maps/{map}/gatherings/{gathering}/tracks/{track}", Teacher),
    map("GET", "/maps/{map}/gatherings/{gathering}/tracks/{track}/views/{view}/icon", Viewer),
    map("POST", "/maps/{map}/gatherings/{gathering}/accept", Teacher),
    map("GET", "/maps/{map}/live", Viewer),
    own("GET", "/robots", Viewer),
    server("GET", "/unknown-robots", Operator),
    robot("GET", "/robots/{robot}", Viewer),
    robot("PUT", "/robots/{robot}", Operator),
    robot("PUT", "/robots/{robot}/pose", Operator),
    robot("DELETE", "/robots/{robot}", Operator),
    robot("GET", "/robots/{robot}/certificates", Viewer),
    robot("POST", "/robots/{robot}/certificates", Operator),
    robot("DELETE", "/robots/{robot}/certificates/{serial}", Operator),
    robot("GET", "/robots/{robot}/ros2", Viewer),
    robot("GET", "/robots/{robot}/corrections", Viewer),
    robot("GET", "/robots/{robot}/relocalisation", Viewer),
    robot("GET", "/robots/{robot}/trajectories", Viewer),
    robot("GET", "/robots/{robot}/recording", Viewer),
    robot("POST", "/robots/{robot}/recording", Operator),
    robot("DELETE", "/robots/{robot}/recording", Operator),
    robot("POST", "/robots/{robot}/recording/reference", Operator),
    robot("GET", "/robots/{robot}/cameras", Viewer),
    robot("POST", "/robots/{robot}/cameras/{camera}/calibrate", Robot),
    robot("GET", "/robots/{robot}/cameras/{camera}/frame", Viewer),
    robot("GET", "/robots/{robot}/cameras/{camera}/answer", Viewer),
    own("GET", "/answers", Viewer),
    answer("GET", "/answers/{answer}", Viewer),
    answer("GET", "/answers/{answer}/quads/{quad}/icon", Viewer),
    own("GET", "/events", Viewer),
    own("GET", "/jobs", Viewer),
    job("GET", "/jobs/{job}", Viewer),
    job("DELETE", "/jobs/{job}", Teacher),
    job("GET", "/jobs/{job}/events", Viewer),
];

/// The table by path: it is read for every request.
static BY_PATH: LazyLock<HashMap<&str, Vec<&Rule>>> = LazyLock::new(|| {
    let mut by_path: HashMap<&str, Vec<&Rule>> = HashMap::new();
    for rule in TABLE {
        by_path.entry(rule.path).or_default().push(rule);
    }
    by_path
});

/// What an operation needs; `None` for one that has no row.
pub(crate) fn access(method: &str, path: &str) -> Option<Access> {
    BY_PATH.get(path)?.iter().find(|rule| rule.method == method).map(|rule| rule.access)
}

/// Why a principal may not do what it asks for. What it may not see looks to it as what does not
/// exist, which is not decided here.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Forbidden {
    /// The operation needs this role.
    Role(Role),
    /// The operation needs a token for all maps.
    AllMaps,
}

/// Whether the role and the kind of the token suffice.
pub(crate) fn check(principal: &Principal, role: Role, scope: Scope) -> Result<(), Forbidden> {
    if principal.role < role {
        return Err(Forbidden::Role(role));
    }
    if scope == Scope::Server && principal.maps.is_some() {
        return Err(Forbidden::AllMaps);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::{collections::BTreeSet, fmt::Write as _, fs, path::Path};

    const HEAD: &str = "# Who may do what\n\n\
        Made from `server/src/identity/authorisation.rs`; \
        `WAYMARK_REFRESH=1 cargo test -p server authorisation` writes it.\n\n\
        Each role may do all that the roles before it may: viewer, robot, teacher, operator, admin. The scope says what \
        a token\nthat is for some maps must include; a token for all maps includes everything. Maps and robots outside \
        of the scope are\nanswered as if they did not exist (404). Without credentials the answer is 401 \
        `unauthenticated`, with too small a role\nor scope 403 `forbidden`. An operation that is not listed is \
        refused.\n\n\
        | scope | needed |\n|---|---|\n\
        | own | nothing more: it is about the asker, or lists only what the asker may see |\n\
        | map | the map of the path |\n\
        | robot | the map on which the robot of the path stands |\n\
        | job | the map of the job |\n\
        | answer | the map of the stored answer |\n\
        | server | a token for all maps |\n\n\
        Paths are below `/api/v1`. The files of the page and the OpenAPI document are open, too; they hold no data.\n\n\
        | operation | least role | scope |\n|---|---|---|\n";

    fn document() -> String {
        TABLE.iter().fold(HEAD.to_owned(), |mut text, Rule { method, path, access }| {
            let (role, scope) = match access {
                Access::Open => ("none", String::new()),
                Access::Needs(role, scope) => (role.as_str(), format!("{scope:?}").to_lowercase()),
            };
            writeln!(text, "| `{method} {path}` | {role} | {scope} |").unwrap();
            text
        })
    }

    #[test]
    fn the_authorisation_document_is_up_to_date() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/AUTHORISATION.md");
        if std::env::var_os("WAYMARK_REFRESH").is_some() {
            fs::write(&path, document()).unwrap();
        }
        let stored = fs::read_to_string(&path).unwrap_or_default();
        assert!(stored == document(), "run WAYMARK_REFRESH=1 cargo test -p server authorisation");
    }

    #[test]
    fn each_operation_has_one_row_and_a_scope_that_fits_its_path() {
        let rows: BTreeSet<_> = TABLE.iter().map(|rule| (rule.method, rule.path)).collect();
        assert_eq!(rows.len(), TABLE.len());
        for Rule { method, path, access } in TABLE {
            let Access::Needs(role, scope) = *access else { continue };
            let named = [
                ("{map}", Scope::Map),
                ("{robot}", Scope::Robot),
                ("{job}", Scope::Job),
                ("{answer}", Scope::Answer),
            ];
            let wanted = named.into_iter().find(|(name, _)| path.contains(name)).map(|(_, scope)| scope);
            // A token for all maps may see every map.
            let fits = |wanted| wanted == scope || scope == Scope::Server;
            assert!(wanted.is_none_or(fits), "{method} {path}: {scope:?}");
            assert!(wanted.is_some() || matches!(scope, Scope::Own | Scope::Server), "{method} {path}");
            let computes = ["/visible", "/coverage", "/gaze", "/session/links"];
            let only_reads = *method == "GET" || computes.iter().any(|end| path.ends_with(end));
            assert!(only_reads || role > Role::Viewer, "a viewer may not {method} {path}");
        }
    }
}
