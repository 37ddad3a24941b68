"""How a client authenticates itself, and verifies the server."""
from __future__ import annotations

import os
from dataclasses import dataclass
from typing import Mapping, Optional, Sequence

import grpc

from . import address
from .errors import InvalidValue

Metadata = tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class Credentials:
    """Files are in PEM format and are read when a connection is made.

    token        a bearer token, sent with every call; read from `token_file` if `token` is empty. Sent only to addresses of
                 this machine or over TLS: elsewhere it could be read in transit, which is an error
    ca           for tls:HOST:PORT: the certificate authorities for the server's certificate (empty: the system's)
    certificate  this client's certificate, and its `key`, for servers that require them
    server_name  the name expected in the server's certificate, if it is not the address's host
    """
    token: str = ""
    token_file: str = ""
    ca: str = ""
    certificate: str = ""
    key: str = ""
    server_name: str = ""

    @classmethod
    def from_environment(cls, environment: Optional[Mapping[str, str]] = None) -> "Credentials":
        """Reads VOXELD_TOKEN or VOXELD_TOKEN_FILE, VOXELD_TLS_CA, VOXELD_TLS_CERT, VOXELD_TLS_KEY, VOXELD_TLS_NAME."""
        env = os.environ if environment is None else environment
        return cls(env.get("VOXELD_TOKEN", ""), env.get("VOXELD_TOKEN_FILE", ""), env.get("VOXELD_TLS_CA", ""),
                   env.get("VOXELD_TLS_CERT", ""), env.get("VOXELD_TLS_KEY", ""), env.get("VOXELD_TLS_NAME", ""))


def _read(what: str, path: str) -> Optional[bytes]:
    if not path:
        return None
    try:
        with open(path, "rb") as file:
            return file.read()
    except OSError as error:
        raise InvalidValue(f"{what} {path!r} cannot be read: {error.strerror}") from None


def metadata(server: str, credentials: Credentials) -> Metadata:
    """Returns the metadata of every call."""
    token = credentials.token or (_read("token_file", credentials.token_file) or b"").decode("utf-8", "replace").strip()
    if not token:
        return ()
    if not all("!" <= c <= "~" for c in token):
        raise InvalidValue("the token has a space, or what is no ASCII; give it as `voxelctl token` printed it")
    if not address.is_tls(server) and not address.is_local(server):
        raise InvalidValue(f"a token would go to {server} readable by all that is in between; give tls:{server}, or take "
                           "the token away")
    return (("authorization", f"Bearer {token}"),)


def open_channel(server: str, credentials: Credentials, options: Sequence[tuple[str, int]]) -> grpc.Channel:
    """Opens a channel to the address; the caller closes it."""
    target = address.target(server)
    if not address.is_tls(server):
        return grpc.insecure_channel(target, options=list(options))
    if bool(credentials.certificate) != bool(credentials.key):
        raise InvalidValue("of certificate and key one is missing; give both, or none")
    tls = grpc.ssl_channel_credentials(_read("ca", credentials.ca), _read("key", credentials.key),
                                       _read("certificate", credentials.certificate))
    more: list[tuple[str, object]] = list(options)
    if credentials.server_name:
        more.append(("grpc.ssl_target_name_override", credentials.server_name))
    return grpc.secure_channel(target, tls, options=more)
