// How a client shows who it is, and knows whom it talks to.
#pragma once

#include <string>

#include "voxeld/address.h"

namespace voxeld::client {

// Files are PEM, read when a connection is made.
struct Credentials {
  // A bearer token, sent with every call; empty: none. Over TCP without TLS whoever is in between could
  // read it: it is sent on addresses of this machine alone, and an error elsewhere.
  std::string token;
  std::string token_file;  // where `token` is empty: what is in this file, read with the others
  // For tls:HOST:PORT: the authorities of the server's certificate (empty: the system's), and this
  // client's certificate and key, which the server asks for.
  std::string ca, certificate, key;
  // The name that the server's certificate must have, where it is not the address's host.
  std::string server_name;
};

// VOXELD_TOKEN, or what is in the file VOXELD_TOKEN_FILE; VOXELD_TLS_CA, VOXELD_TLS_CERT, VOXELD_TLS_KEY,
// VOXELD_TLS_NAME. Whichever is not set is empty; what is wrong with a file shows when a connection is
// made.
Credentials DefaultCredentials(const Environment& environment);
// Of this process's environment.
Credentials DefaultCredentials();

}  // namespace voxeld::client
