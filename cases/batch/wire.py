"""Messages between the process of a batch and its workers: pickles, each after its length, through pipes.

Surfaces and meshes, of which many messages have the same, are sent to each worker once.
"""

import io
import pickle
import struct
from collections.abc import Iterator
from typing import IO, Any

from tetlux.cases.batch.jobs import MeshData
from tetlux.meshing.surface.surface import Surface
from tetlux.meshing.tets.mesh import TetMesh

# What is sent once; and how many of these a worker keeps.
SHARED = (Surface, TetMesh, MeshData)
MOST_KEPT = 16
_LENGTH = struct.Struct("<Q")
# Kinds of messages.
_KEEP, _FORGET, _MESSAGE = range(3)


class _Pickler(pickle.Pickler):
    """Pickles a reference in place of each shared object, and collects these."""

    def __init__(self, buffer: io.BytesIO) -> None:
        super().__init__(buffer, protocol=5)
        self.shared: dict[int, object] = {}

    def persistent_id(self, obj: Any) -> int | None:
        if not isinstance(obj, SHARED):
            return None
        self.shared[id(obj)] = obj
        return id(obj)


class _Unpickler(pickle.Unpickler):
    def __init__(self, buffer: io.BytesIO, shared: dict[int, object]) -> None:
        super().__init__(buffer)
        self._shared = shared

    def persistent_load(self, pid: Any) -> object:
        return self._shared[pid]


def pack(message: object) -> tuple[bytes, dict[int, object]]:
    """Pickle a message; and the shared objects that it refers to, by number."""
    buffer = io.BytesIO()
    pickler = _Pickler(buffer)
    pickler.dump(message)
    return buffer.getvalue(), pickler.shared


def unpack(data: bytes, shared: dict[int, object]) -> Any:
    """The message of `pack`."""
    return _Unpickler(io.BytesIO(data), shared).load()


class Sender:
    """Sends messages into a stream."""

    def __init__(self, stream: IO[bytes]) -> None:
        self._stream = stream
        # Kept alive, so that no other object gets their number.
        self._sent: dict[int, object] = {}

    def send(self, message: object) -> None:
        """Send a message, after those shared objects that have not been sent; OSError if the reader is gone."""
        data, shared = pack(message)
        for key, obj in shared.items():
            if key not in self._sent:
                self._write((_KEEP, key, pickle.dumps(obj, protocol=5)))
        self._sent = {key: obj for key, obj in self._sent.items() if key not in shared} | shared
        self._write((_MESSAGE, 0, data))
        for key in list(self._sent)[: max(0, len(self._sent) - MOST_KEPT)]:
            del self._sent[key]
            self._write((_FORGET, key, b""))
        self._stream.flush()

    def _write(self, frame: tuple[int, int, bytes]) -> None:
        data = pickle.dumps(frame, protocol=5)
        self._stream.write(_LENGTH.pack(len(data)))
        self._stream.write(data)


def receive(stream: IO[bytes]) -> Iterator[Any]:
    """Receive messages until the sender is gone."""
    shared: dict[int, object] = {}
    while (head := stream.read(_LENGTH.size)) and len(head) == _LENGTH.size:
        data = stream.read(_LENGTH.unpack(head)[0])
        if len(data) < _LENGTH.unpack(head)[0]:
            return
        kind, key, content = pickle.loads(data)
        if kind == _KEEP:
            shared[key] = pickle.loads(content)
        elif kind == _FORGET:
            del shared[key]
        else:
            yield unpack(content, shared)
