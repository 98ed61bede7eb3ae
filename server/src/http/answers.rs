//! Parts of answers: pages of lists, covariances, what is kept of creations.

use super::{error::ApiError, extract::page_limit};
use crate::store::kept_answers::{Answer, answered};
use axum::{Json, http::StatusCode};
use nalgebra::Matrix3;
use protos::api::{ListOrder, ListQuery, Page};
use serde::Serialize;

/// Nine numbers, row by row.
pub(super) fn row_major(matrix: &Matrix3<f64>) -> [f64; 9] {
    std::array::from_fn(|i| matrix[(i / 3, i % 3)])
}

/// A page from one row more than asked for, which only says that there is a next page; `total` are
/// the items of all pages.
pub(super) fn page<R, T>(
    mut rows: Vec<R>,
    limit: usize,
    total: u64,
    key: impl Fn(&R) -> String,
    item: impl Fn(R) -> T,
) -> Page<T> {
    let more = rows.len() > limit;
    rows.truncate(limit);
    let next = if more { rows.last().map(key) } else { None };
    Page { items: rows.into_iter().map(item).collect(), next, total }
}

/// What a list is sorted by.
pub(super) trait Listed {
    /// Unique in the list.
    fn name(&self) -> &str;

    /// When it was changed last, ms since the Unix epoch; `None` where that is not known.
    fn changed_ms(&self) -> Option<i64>;
}

/// The page of a list that is read whole: the items whose name fits, in the order asked for.
pub(super) fn selected<T: Listed>(
    mut items: Vec<T>,
    query: &ListQuery,
    max: usize,
) -> Result<Page<T>, ApiError> {
    let (limit, sort) = (page_limit(query.limit, max)?, query.sort.unwrap_or_default());
    if let Some(part) = &query.name {
        items.retain(|item| item.name().contains(part.as_str()));
    }
    let by_change = matches!(sort, ListOrder::Changed | ListOrder::ChangedReversed);
    if by_change && items.iter().any(|item| item.changed_ms().is_none()) {
        return Err(ApiError::invalid("invalid_value", "sort", "this list is sorted by name only"));
    }
    items.sort_by(|a, b| {
        let by_time = if by_change { a.changed_ms().cmp(&b.changed_ms()) } else { std::cmp::Ordering::Equal };
        by_time.then_with(|| a.name().cmp(b.name()))
    });
    if matches!(sort, ListOrder::NameReversed | ListOrder::ChangedReversed) {
        items.reverse();
    }
    let from = match (query.cursor.as_deref(), sort) {
        (None, _) => 0,
        (Some(last), ListOrder::Name) => items.partition_point(|item| item.name() <= last),
        (Some(last), ListOrder::NameReversed) => items.partition_point(|item| item.name() >= last),
        (Some(last), _) => {
            let at = items.iter().position(|item| item.name() == last);
            let gone = "what the page before ended with is gone: begin with the first page";
            at.ok_or_else(|| ApiError::invalid("invalid_value", "cursor", gone))? + 1
        }
    };
    let total = items.len() as u64;
    let rest: Vec<T> = items.into_iter().skip(from).take(limit + 1).collect();
    Ok(page(rest, limit, total, |item| item.name().to_owned(), |item| item))
}

impl<T> Listed for (String, T) {
    fn name(&self) -> &str {
        &self.0
    }

    fn changed_ms(&self) -> Option<i64> {
        None
    }
}

/// The answer to a creation: `shown` of what `work` makes by one write. If the request has a key,
/// it is kept with that write.
pub(super) async fn created<T: 'static, B: Serialize, E: Into<ApiError>>(
    shown: impl Fn(&T) -> (StatusCode, B) + Clone + Send + Sync + 'static,
    work: impl Future<Output = Result<T, E>>,
) -> Result<(StatusCode, Json<B>), ApiError> {
    let answer = shown.clone();
    let kept = move |made: &T| {
        let (status, body) = answer(made);
        Answer::json(status.as_u16(), &body)
    };
    let made = answered(kept, work).await.map_err(Into::into)?;
    let (status, body) = shown(&made);
    Ok((status, Json(body)))
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Item(&'static str, i64);

    impl Listed for Item {
        fn name(&self) -> &str {
            self.0
        }

        fn changed_ms(&self) -> Option<i64> {
            Some(self.1)
        }
    }

    fn pages(sort: ListOrder, name: Option<&str>) -> (String, u64) {
        let mut query =
            ListQuery { limit: Some(2), cursor: None, name: name.map(str::to_owned), sort: Some(sort) };
        let mut all = String::new();
        loop {
            let items = vec![Item("b", 3), Item("ab", 1), Item("c", 2), Item("a", 3)];
            let page = selected(items, &query, 9).unwrap();
            all.extend(page.items.iter().map(|item| format!("{} ", item.0)));
            query.cursor = page.next;
            if query.cursor.is_none() {
                return (all.trim_end().to_owned(), page.total);
            }
            all.push('|');
        }
    }

    #[test]
    fn pages_of_a_list_that_is_read_whole_have_every_item_once() {
        let words = |text: &str, total| (text.to_owned(), total);
        assert_eq!(pages(ListOrder::Name, None), words("a ab |b c", 4));
        assert_eq!(pages(ListOrder::NameReversed, None), words("c b |ab a", 4));
        assert_eq!(pages(ListOrder::Changed, None), words("ab c |a b", 4));
        assert_eq!(pages(ListOrder::ChangedReversed, None), words("b a |c ab", 4));
        assert_eq!(pages(ListOrder::Name, Some("b")), words("ab b", 2));
        let gone =
            ListQuery { cursor: Some("z".into()), sort: Some(ListOrder::Changed), ..ListQuery::default() };
        assert_eq!(selected(vec![Item("a", 1)], &gone, 9).err().map(|e| e.code), Some("invalid_value"));
        let by_time = ListQuery { sort: Some(ListOrder::Changed), ..ListQuery::default() };
        assert!(selected(vec![("a".to_owned(), ())], &by_time, 9).is_err(), "no times, and sorted by them");
    }
}
