// How a client authenticates itself, and verifies the server.
#pragma once

#include <string>

#include "voxeld/address.h"

namespace voxeld::client {

// Files are in PEM format and are read when a connection is made.
struct Credentials {
  // A bearer token, sent with every call; empty: none. Over TCP without TLS anyone on the path
  // could read it: it is then sent only to addresses of this machine, and is an error elsewhere.
  std::string token;
  std::string token_file;  // file to read the token from if `token` is empty; read with the others
  // For tls:HOST:PORT: the certificate authorities that may sign the server's certificate (empty:
  // the system's), and this client's certificate and key, for servers that require them.
  std::string ca, certificate, key;
  // The name expected in the server's certificate, if it is not the address's host.
  std::string server_name;
};

// Reads VOXELD_TOKEN, or the file VOXELD_TOKEN_FILE, and VOXELD_TLS_CA, VOXELD_TLS_CERT,
// VOXELD_TLS_KEY and VOXELD_TLS_NAME. Fields whose variable is not set are empty; errors of files
// are reported when a connection is made.
Credentials DefaultCredentials(const Environment& environment);
// The same with this process's environment.
Credentials DefaultCredentials();

}  // namespace voxeld::client
