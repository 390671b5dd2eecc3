"""WebSocket frames (RFC 6455) of the common kind: a whole message, short, in one frame. All others are a library's."""

from __future__ import annotations

from websockets.frames import apply_mask  # type: ignore[attr-defined]

LONGEST_BYTES = 16_384
_FINAL, _MASKED, _TWO_BYTES = 0x80, 0x80, 126
_TEXT, _BINARY = 1, 2
_MASK_BYTES, _SHORTEST = 4, 6


def whole_message(data: bytes) -> tuple[bool, bytes] | None:
    """Whether it is text, and its bytes, if `data` is one client's message in one frame, all of it and no more."""
    if len(data) < _SHORTEST or not data[1] & _MASKED:
        return None
    is_text, length, start = data[0] == _FINAL | _TEXT, data[1] & ~_MASKED, 2
    if not is_text and data[0] != _FINAL | _BINARY:
        return None
    if length >= _TWO_BYTES:
        if length > _TWO_BYTES:
            return None
        length, start = int.from_bytes(data[2:4]), 4
    content = start + _MASK_BYTES
    if length > LONGEST_BYTES or len(data) != content + length:
        return None
    return is_text, apply_mask(data[content:], data[start:content])


def framed(content: bytes, *, is_text: bool) -> bytes:
    """A server's message of at most LONGEST_BYTES as one frame."""
    kind, length = _FINAL | (_TEXT if is_text else _BINARY), len(content)
    if length < _TWO_BYTES:
        return bytes((kind, length)) + content
    return bytes((kind, _TWO_BYTES)) + length.to_bytes(2) + content
