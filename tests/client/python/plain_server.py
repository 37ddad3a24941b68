"""A server that implements scene.proto as plainly as possible: the client is judged by it. One thread, no gRPC."""
from __future__ import annotations

from typing import Any, Iterator, Optional

from voxeld.v1 import primitives_pb2, types_pb2
from voxeld.v1 import scene_pb2 as pb

REFUSED = "refuse this"  # the label of an entity that is refused
NOTED = "note this"  # the label of one that is accepted with an Issue

Scene = dict[str, dict[str, bytes]]  # layer → id → Entity, serialised; layers in the order of their creation


class Refusal(Exception):
    """The refusal of one operation."""

    def __init__(self, layer: str, id: str, reason: Any, message: str = "refused") -> None:
        super().__init__(message)
        self.layer, self.id, self.reason, self.message = layer, id, reason, message


class TooLarge(Exception):
    """The refusal of a message: a real server ends the stream with RESOURCE_EXHAUSTED."""


class Session:
    """The layers of one session in the scene, and what it is sent after it is resumed."""

    def __init__(self, owner: int = 0) -> None:
        self.owner = owner
        self.token = b""
        self.keeps = False
        self.strict = False
        self.scene: Scene = {}
        self.objects: dict[str, bytes] = {}
        self.states: dict[str, Any] = {}
        self.last_frame_id: Optional[int] = None
        self.last_sequence: Optional[int] = None
        self.owed: list[pb.Receipt] = []

    def clear(self) -> None:
        self.scene, self.states, self.objects = {}, {}, {}

    def state(self) -> tuple[Scene, dict[str, bytes], dict[str, Any]]:
        return {layer: dict(held) for layer, held in self.scene.items()}, dict(self.objects), dict(self.states)

    def set_state(self, state: tuple[Scene, dict[str, bytes], dict[str, Any]]) -> None:
        self.scene, self.objects, self.states = state


class PlainServer:
    """Sessions and streams. `window`: how many bytes may be sent and not yet applied; 0: no flow control. `owes`: whether outstanding
    outcomes are sent
    after a resume."""

    def __init__(self, window: int = 0, displays: tuple[str, ...] = ("d",), max_message_bytes: int = 16 << 20,
                 max_uncommitted_bytes: int = 256 << 20, max_operations: int = 1_000_000, outcomes: bool = True) -> None:
        self.window = window
        self.displays = displays
        self.limits = types_pb2.Limits(max_message_bytes=max_message_bytes, max_uncommitted_bytes=max_uncommitted_bytes,
                                       max_operations_per_commit=max_operations)
        self.outcomes = outcomes  # whether outcomes are sent at once; otherwise they are outstanding
        self.sessions: dict[bytes, Session] = {}
        self.owners: dict[bytes, int] = {}
        self.tokens = 0
        self.now_ns = 1000
        self.commits: list[int] = []  # every commit id that was applied, in order
        self.commit_bytes: list[int] = []
        self.client_drops = 0
        self.frames_seen = 0
        self.session: Optional[Session] = None
        self.timed: list[tuple[pb.Commit, int, list[tuple[int, pb.StreamRequest]]]] = []

    def forget(self) -> None:
        """Forgets all sessions, as after a restart."""
        self.sessions.clear()
        self.owners.clear()
        self.timed = []

    def begin(self) -> None:
        """Starts a new stream; the one before has ended."""
        self.session = None
        self.timed = []
        self.received = self.applied = 0
        self.credit = 0
        self.staged: list[tuple[int, pb.StreamRequest]] = []
        self.sequence = 0
        self.opened = False

    def receive(self, message: bytes) -> list[pb.StreamResponse]:
        """Takes one request; raises LookupError where a real server ends the stream with NOT_FOUND."""
        # A message may exceed the remaining credit only if some credit was left when it was sent.
        assert not self.opened or not self.window or self.received < self.credit, (self.received, self.credit)
        if len(message) > self.limits.max_message_bytes:
            raise TooLarge(len(message))
        self.received += len(message)
        request = pb.StreamRequest.FromString(message)
        what = request.WhichOneof("op")
        # A ping has a sequence if it counts as a request.
        assert not request.sequence or request.sequence > self.sequence
        self.sequence = request.sequence or self.sequence + (what != "ping")
        if not self.opened:
            assert what == "open", f"{what} before Opened"
            return [self._open(request.open)]
        assert what != "open"
        if what == "ping":
            return [pb.StreamResponse(pong=pb.Pong(client_time_ns=request.ping.client_time_ns,
                                                   received_time_ns=self.now_ns, server_time_ns=self.now_ns))]
        if what != "commit":
            self.staged.append((self.sequence, request))
            return []
        staged, self.staged = self.staged, []
        if request.commit.present_at_ns > self.now_ns:
            self.timed.append((request.commit, self.sequence, staged))
            response = pb.StreamResponse()
            response.receipts.add(frame_id=request.commit.frame_id, sequence=self.sequence,
                                  scheduled=pb.Scheduled(present_at_ns=request.commit.present_at_ns))
            return [response]
        return [self._commit(request.commit, self.sequence, staged)]

    def advance(self, now_ns: int) -> list[pb.StreamResponse]:
        """Advances the time; commits whose time has come are applied."""
        self.now_ns = now_ns
        due = [one for one in self.timed if one[0].present_at_ns <= now_ns]
        self.timed = [one for one in self.timed if one[0].present_at_ns > now_ns]
        return [self._commit(*one) for one in due]

    def give_credit(self) -> list[pb.StreamResponse]:
        """Gives credit for everything that has been handled: applied, or staged for a commit that has not arrived."""
        if not self.window or self.credit >= self.received + self.window:
            return []
        self.credit = self.received + self.window
        return [pb.StreamResponse(credit_bytes=self.credit)]

    def pay(self) -> list[pb.StreamResponse]:
        """Sends the outstanding outcomes."""
        assert self.session is not None
        owed, self.session.owed = self.session.owed, []
        return [pb.StreamResponse(receipts=[receipt]) for receipt in owed]

    def _open(self, request: pb.Open) -> pb.StreamResponse:
        if request.resume_token:
            if request.resume_token not in self.sessions:
                raise LookupError("no such session")
            self.session = self.sessions.pop(request.resume_token)
            if not self.session.keeps:  # its layers were removed with its stream
                self.session.clear()
        elif request.owner_token:
            if request.owner_token not in self.owners:
                raise LookupError("no such owner")
            self.session = Session(self.owners[request.owner_token])
        else:
            self.session = Session(len(self.owners) + 1)
            self.owners[f"owner{self.tokens}".encode()] = self.session.owner
        self.session.keeps = request.on_disconnect == pb.DISCONNECT_POLICY_KEEP
        self.session.strict = request.strict
        self.tokens += 1
        self.session.token = f"token{self.tokens}".encode()
        self.sessions[self.session.token] = self.session
        self.opened = True
        self.credit = self.window
        (owner_token,) = (token for token, owner in self.owners.items() if owner == self.session.owner)
        opened = pb.Opened(session=self.tokens, resume_token=self.session.token, credit_bytes=self.window, limits=self.limits,
                           displays=self.displays, server_time_ns=self.now_ns, owner=self.session.owner,
                           owner_token=owner_token)
        if request.resume_token and self.session.last_frame_id is not None:
            opened.last_frame_id = self.session.last_frame_id
            opened.last_sequence = self.session.last_sequence or 0
        return pb.StreamResponse(opened=opened)

    def _commit(self, commit: pb.Commit, sequence: int, staged: list[tuple[int, pb.StreamRequest]]) -> pb.StreamResponse:
        assert self.session is not None
        issues: list[pb.Issue] = []
        before = self.session.state()
        frames_before = self.frames_seen
        frame: Optional[str] = None
        held: Optional[dict[str, bytes]] = None
        size = 0

        def refuse(at: int, refusal: Refusal) -> None:
            issues.append(pb.Issue(sequence=at, layer=refusal.layer, id=refusal.id, reason=refusal.reason,
                                   message=refusal.message))

        for count, (at, request) in enumerate(staged):
            what = request.WhichOneof("op")
            size += request.ByteSize()
            if count >= self.limits.max_operations_per_commit or size > self.limits.max_uncommitted_bytes:
                refuse(at, Refusal("", "", types_pb2.REASON_QUOTA_EXCEEDED, "too much waits for a commit"))
            elif what == "frame_begin":
                assert frame is None
                frame, held = request.frame_begin.layer, self.session.scene.get(request.frame_begin.layer)
                self.session.scene[frame] = {}
            elif what == "frame_end":
                assert frame == request.frame_end.layer
                frame = None
                self.frames_seen += 1
            else:
                for one in alone(request):
                    try:
                        apply(self.session, one)
                        if one.upsert.entity.label == NOTED:
                            issues.append(pb.Issue(sequence=at, layer=one.upsert.layer, id=one.upsert.id, applied=True))
                    except Refusal as refusal:
                        refuse(at, refusal)
        if frame is not None:  # the batch has no FrameEnd, and its layer is unchanged
            if held is None:
                del self.session.scene[frame]
            else:
                self.session.scene[frame] = held
        self.commit_bytes.append(size)
        response = pb.StreamResponse(issues=issues)
        if issues and self.session.strict:
            self.session.set_state(before)
            self.frames_seen = frames_before
            refused = pb.Refused(refused_operations=len(issues), message="the session is strict")
            response.receipts.add(frame_id=commit.frame_id, sequence=sequence, refused=refused)
            return response
        self.client_drops += commit.client_drops
        if commit.frame_id:
            self.commits.append(commit.frame_id)
        if self.session.last_sequence is None or sequence > self.session.last_sequence or sequence == self.sequence:
            self.session.last_frame_id, self.session.last_sequence = commit.frame_id, sequence
        accepted = pb.Accepted(snapshot=len(self.commits), displays=self.displays, refused_operations=len(issues),
                               late=0 < commit.present_at_ns < self.now_ns)
        response.receipts.add(frame_id=commit.frame_id, sequence=sequence, accepted=accepted)
        for display in self.displays:
            outcome = pb.Outcome(display=display, presented=pb.Presented(volume=1))
            receipt = pb.Receipt(frame_id=commit.frame_id, sequence=sequence, outcome=outcome)
            (response.receipts if self.outcomes else self.session.owed).append(receipt)
        return response


def alone(request: pb.StreamRequest) -> Iterator[pb.StreamRequest]:
    """Yields a batch's upserts one by one."""
    if request.WhichOneof("op") != "batch":
        yield request
    for upsert in request.batch.upserts:
        yield pb.StreamRequest(upsert=upsert)


def used_by(definition: bytes) -> set[str]:
    parts = primitives_pb2.Object.FromString(definition).parts
    return {part.primitive.instance.object for part in parts if part.primitive.HasField("instance")}


def reached(session: Session, start: str) -> set[str]:
    """Returns the objects in `start` and all objects that they reach."""
    seen: set[str] = set()
    ahead = [start]
    while ahead:
        for used in used_by(session.objects.get(ahead.pop(), b"")) - seen:
            seen.add(used)
            ahead.append(used)
    return seen


def drawn_by(entity: bytes) -> str:
    primitive = pb.Entity.FromString(entity).primitive
    return str(primitive.instance.object) if primitive.HasField("instance") else ""


def apply(session: Session, request: pb.StreamRequest) -> None:
    """Applies an operation outside frames, one upsert at a time; raises Refusal."""
    what = request.WhichOneof("op")
    if what == "upsert":
        upsert = request.upsert
        used = upsert.entity.primitive.instance.object
        if upsert.entity.label == REFUSED:
            raise Refusal(upsert.layer, upsert.id, types_pb2.REASON_INVALID_VALUE)
        if used and used not in session.objects:
            raise Refusal(upsert.layer, upsert.id, types_pb2.REASON_NOT_FOUND, f"object {used} is not defined")
        session.scene.setdefault(upsert.layer, {})[upsert.id] = upsert.entity.SerializeToString(deterministic=True)
    elif what == "delete":
        kind = request.delete.WhichOneof("what")
        if kind == "all_mine":
            session.scene.clear()
            session.states.clear()
        else:
            layer = session.scene.get(request.delete.layer, {})
            if kind == "id":
                layer.pop(request.delete.id, None)
            else:
                assert kind == "all_of_layer"
                layer.clear()
    elif what == "set_transform":
        move = request.set_transform
        if move.id not in session.scene.get(move.layer, {}):
            raise Refusal(move.layer, move.id, types_pb2.REASON_NOT_FOUND, "upsert it first")
        entity = pb.Entity.FromString(session.scene[move.layer][move.id])
        entity.transform.CopyFrom(move.transform)
        session.scene[move.layer][move.id] = entity.SerializeToString(deterministic=True)
    elif what == "layer_state":
        session.scene.setdefault(request.layer_state.layer, {})
        for field, value in request.layer_state.ListFields():
            if field.name != "layer":
                session.states[f"{request.layer_state.layer}.{field.name}"] = value
    elif what == "define_object":
        name = request.define_object.object
        definition = request.define_object.definition.SerializeToString(deterministic=True)
        for used in used_by(definition):
            if used not in session.objects:
                raise Refusal("", name, types_pb2.REASON_NOT_FOUND, f"object {used} is not defined")
            if name == used or name in reached(session, used):
                raise Refusal("", name, types_pb2.REASON_CYCLE)
        session.objects[name] = definition
    elif what == "delete_object":
        _delete_object(session, request.delete_object)
    else:
        raise AssertionError(what)


def _delete_object(session: Session, request: pb.DeleteObject) -> None:
    name = request.object
    if name not in session.objects:
        raise Refusal("", name, types_pb2.REASON_NOT_FOUND)
    instances = [(layer, id) for layer, held in session.scene.items() for id, entity in held.items()
                 if drawn_by(entity) == name]
    users = [user for user, definition in session.objects.items() if name in used_by(definition)]
    if not request.cascade and (instances or users):
        raise Refusal("", name, types_pb2.REASON_IN_USE)
    for layer, id in instances:
        del session.scene[layer][id]
    for user in users:
        parts = primitives_pb2.Object.FromString(session.objects[user]).parts
        left = primitives_pb2.Object(parts=[part for part in parts if part.primitive.instance.object != name])
        session.objects[user] = left.SerializeToString(deterministic=True)
    del session.objects[name]
