"""Limits of the server: how many clients, how large, how long."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Limits:
    """Limits on what the pages of all clients can make the server do."""

    clients: int = 4
    """Clients at the same time."""
    memory: int = 4_000_000_000
    """Resident memory of one client process, in bytes."""
    upload: int = 500_000_000
    """Body of one upload, in bytes."""
    keep: float = 600.0
    """Seconds for which a client without a page is kept."""
    message: int = 1 << 20
    """One message of a page, in bytes."""
    rate: float = 500.0
    """Messages of a page per second, on average over `burst` messages."""
    burst: int = 2500
    """Messages that a page may send at once."""
    unread: int = 64
    """Messages of a page that its client process has not handled yet."""
    start: float = 120.0
    """Seconds in which a client process must start."""
    requests: int = 64
    """Requests and WebSockets of one client at the same time."""
    waiting: int = 256
    """Connections of all visitors on which no request of a client is being answered."""
    patience: float = 30.0
    """Seconds to wait for a request, for the next part of an upload, and for a page that reads."""
