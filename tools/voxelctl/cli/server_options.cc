#include "tools/voxelctl/cli/server_options.h"

#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>
#include <algorithm>
#include <iterator>
#include <utility>

namespace voxeld::voxelctl {
namespace {

constexpr std::string_view kNames[] = {"--server",   "--token-file", "--tls-ca",
                                       "--tls-cert", "--tls-key",    "--tls-name"};

}  // namespace

void AddServerOptions(CLI::App& app, std::string* server, client::Credentials* credentials) {
  app.add_option(
         "--server", *server,
         "Address of voxeld: HOST:PORT, tls:HOST:PORT or unix:PATH (default: VOXELD_SERVER, "
         "else its socket, else 127.0.0.1:50551)")
      ->type_name("ADDR");
  app.add_option("--token-file", credentials->token_file,
                 "Who you are: a file with a token (default: VOXELD_TOKEN, VOXELD_TOKEN_FILE)")
      ->type_name("FILE");
  app.add_option("--tls-ca", credentials->ca,
                 "The authorities of the server's certificate, PEM (default: VOXELD_TLS_CA, else "
                 "the system's)")
      ->type_name("FILE");
  app.add_option("--tls-cert", credentials->certificate,
                 "Your certificate, PEM (default: VOXELD_TLS_CERT)")
      ->type_name("FILE");
  app.add_option("--tls-key", credentials->key, "Its key, PEM (default: VOXELD_TLS_KEY)")
      ->type_name("FILE");
  app.add_option("--tls-name", credentials->server_name,
                 "The name in the server's certificate, where it is not the address's (default: "
                 "VOXELD_TLS_NAME)")
      ->type_name("NAME");
}

bool IsServerOption(std::string_view word) {
  return std::find(std::begin(kNames), std::end(kNames), word) != std::end(kNames);
}

client::Credentials ChooseCredentials(client::Credentials given,
                                      const client::Environment& environment) {
  client::Credentials chosen = client::DefaultCredentials(environment);
  if (!given.token_file.empty()) {
    chosen.token.clear();
    chosen.token_file = std::move(given.token_file);
  }
  for (std::string client::Credentials::*field :
       {&client::Credentials::ca, &client::Credentials::certificate, &client::Credentials::key,
        &client::Credentials::server_name}) {
    if (!(given.*field).empty()) chosen.*field = std::move(given.*field);
  }
  return chosen;
}

}  // namespace voxeld::voxelctl
