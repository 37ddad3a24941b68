# What this package uses of grpcio 1.51, which has no types of its own.
from enum import Enum
from typing import Any, Callable, Generic, Iterable, Iterator, Optional, Sequence, Tuple, TypeVar

_Request = TypeVar("_Request")
_Response = TypeVar("_Response")

class StatusCode(Enum):
    OK: StatusCode
    CANCELLED: StatusCode
    UNKNOWN: StatusCode
    INVALID_ARGUMENT: StatusCode
    DEADLINE_EXCEEDED: StatusCode
    NOT_FOUND: StatusCode
    ALREADY_EXISTS: StatusCode
    PERMISSION_DENIED: StatusCode
    RESOURCE_EXHAUSTED: StatusCode
    FAILED_PRECONDITION: StatusCode
    ABORTED: StatusCode
    OUT_OF_RANGE: StatusCode
    UNIMPLEMENTED: StatusCode
    INTERNAL: StatusCode
    UNAVAILABLE: StatusCode
    DATA_LOSS: StatusCode
    UNAUTHENTICATED: StatusCode

class RpcError(Exception):
    def code(self) -> StatusCode: ...
    def details(self) -> str: ...

class StreamStreamCall(Generic[_Request, _Response]):
    def __iter__(self) -> Iterator[_Response]: ...
    def cancel(self) -> bool: ...

class UnaryStreamCall(Generic[_Response]):
    def __iter__(self) -> Iterator[_Response]: ...
    def cancel(self) -> bool: ...

class StreamStreamMultiCallable(Generic[_Request, _Response]):
    def __call__(self, request_iterator: Iterable[_Request], timeout: Optional[float] = ..., metadata: Optional[Sequence[Tuple[str, str]]] = ...) -> StreamStreamCall[_Request, _Response]: ...

class UnaryStreamMultiCallable(Generic[_Request, _Response]):
    def __call__(self, request: _Request, timeout: Optional[float] = ..., metadata: Optional[Sequence[Tuple[str, str]]] = ...) -> UnaryStreamCall[_Response]: ...

class UnaryUnaryMultiCallable(Generic[_Request, _Response]):
    def __call__(self, request: _Request, timeout: Optional[float] = ..., metadata: Optional[Sequence[Tuple[str, str]]] = ..., wait_for_ready: Optional[bool] = ...) -> _Response: ...

class Channel:
    def stream_stream(self, method: str, request_serializer: Optional[Callable[[Any], bytes]] = ..., response_deserializer: Optional[Callable[[bytes], Any]] = ...) -> StreamStreamMultiCallable[Any, Any]: ...
    def stream_unary(self, method: str, request_serializer: Optional[Callable[[Any], bytes]] = ..., response_deserializer: Optional[Callable[[bytes], Any]] = ...) -> Callable[..., Any]: ...
    def unary_stream(self, method: str, request_serializer: Optional[Callable[[Any], bytes]] = ..., response_deserializer: Optional[Callable[[bytes], Any]] = ...) -> UnaryStreamMultiCallable[Any, Any]: ...
    def unary_unary(self, method: str, request_serializer: Optional[Callable[[Any], bytes]] = ..., response_deserializer: Optional[Callable[[bytes], Any]] = ...) -> UnaryUnaryMultiCallable[Any, Any]: ...
    def close(self) -> None: ...

def insecure_channel(target: str, options: Optional[Sequence[Tuple[str, Any]]] = ...) -> Channel: ...

class ChannelCredentials: ...

def ssl_channel_credentials(root_certificates: Optional[bytes] = ..., private_key: Optional[bytes] = ..., certificate_chain: Optional[bytes] = ...) -> ChannelCredentials: ...
def secure_channel(target: str, credentials: ChannelCredentials, options: Optional[Sequence[Tuple[str, Any]]] = ...) -> Channel: ...
