//! Waiting for the device without blocking a thread.

use std::future::Future;
use std::pin::Pin;
use std::sync::{Arc, Mutex};
use std::task::{Context, Poll, Waker};

/// A value that a callback delivers once.
pub(super) struct Signal<T>(Arc<Mutex<Delivery<T>>>);

struct Delivery<T> {
    value: Option<T>,
    waker: Option<Waker>,
}

impl<T: Send + 'static> Signal<T> {
    /// Returns the future and the callback that completes it.
    pub(super) fn new() -> (Signal<T>, impl FnOnce(T) + Send + 'static) {
        let delivery = Arc::new(Mutex::new(Delivery { value: None, waker: None }));
        let sender = Arc::clone(&delivery);
        let send = move |value| {
            if let Ok(mut delivery) = sender.lock() {
                delivery.value = Some(value);
                if let Some(waker) = delivery.waker.take() {
                    waker.wake();
                }
            }
        };
        (Signal(delivery), send)
    }
}

impl<T> Future for Signal<T> {
    type Output = T;

    fn poll(self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<T> {
        // The callback only stores a value, so the value behind a poisoned lock is valid.
        let mut delivery = self.0.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        match delivery.value.take() {
            Some(value) => Poll::Ready(value),
            None => {
                delivery.waker = Some(context.waker().clone());
                Poll::Pending
            }
        }
    }
}
