//! On whose behalf a write is made. In: the request or the work that a task does. Out: what the
//! audit log and the history of maps name.

use std::{future::Future, sync::Arc};

/// Longest target that is stored, characters; the path of a request is cut there.
const MAX_TARGET: usize = 512;

tokio::task_local! {
    static ACTOR: Arc<Actor>;
}

/// Who asks for a write, and by what.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Actor {
    /// Name of the token, at most 64 characters.
    pub(crate) name: String,
    /// Number of a stored token.
    pub(crate) token: Option<i64>,
    /// Method and path of the operation, or what the server does; at most 128 characters.
    pub(crate) action: String,
    /// Path of the request.
    pub(crate) target: String,
    /// Id of the request.
    pub(crate) request: Option<String>,
    /// Of a job that writes: its number, and who asked for it.
    pub(crate) job: Option<(i64, String)>,
    /// The reason that was given, for the history of maps.
    pub(crate) why: Option<String>,
}

impl Actor {
    /// The server itself, which does `action` to `target`.
    pub(crate) fn server(action: &str, target: impl Into<String>) -> Self {
        let name = "server".to_owned();
        let (action, target) = (action.to_owned(), target.into());
        Self { name, token: None, action, target, request: None, job: None, why: None }
    }

    /// Does `work` on behalf of this actor.
    pub(crate) async fn scope<T>(mut self, work: impl Future<Output = T>) -> T {
        if let Some((at, _)) = self.target.char_indices().nth(MAX_TARGET) {
            self.target.truncate(at);
        }
        ACTOR.scope(Arc::new(self), work).await
    }

    /// That of the present task.
    pub(crate) fn current() -> Option<Arc<Self>> {
        ACTOR.try_with(Arc::clone).ok()
    }
}

/// `work` for a task of its own, on behalf of whom this task works.
pub(crate) async fn inherited<T>(actor: Option<Arc<Actor>>, work: impl Future<Output = T>) -> T {
    match actor {
        Some(actor) => ACTOR.scope(actor, work).await,
        None => work.await,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn a_target_is_cut_between_characters_and_handed_on() {
        let long = "ä".repeat(MAX_TARGET + 1);
        let seen = Actor::server("test", long)
            .scope(async {
                let actor = Actor::current();
                let task = inherited(actor, async { Actor::current() });
                tokio::spawn(task).await.unwrap()
            })
            .await;
        assert_eq!(seen.unwrap().target.chars().count(), MAX_TARGET);
        assert_eq!(Actor::current(), None);
    }
}
