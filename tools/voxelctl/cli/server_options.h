// The options for the server's address and the caller's identity.
#pragma once

#include <string>
#include <string_view>

#include "voxeld/credentials.h"

namespace CLI {
class App;
}

namespace voxeld::voxelctl {

// All except --server override the environment. References passed in live as long as the app.
void AddServerOptions(CLI::App& app, std::string* server, client::Credentials* credentials);

// Returns whether the word is such an option, which takes the next word.
bool IsServerOption(std::string_view word);

// Returns `given`, completed from the environment.
client::Credentials ChooseCredentials(client::Credentials given,
                                      const client::Environment& environment);

}  // namespace voxeld::voxelctl
