// The options that say where the server is and who the caller is.
#pragma once

#include <string>
#include <string_view>

#include "voxeld/credentials.h"

namespace CLI {
class App;
}

namespace voxeld::voxelctl {

// All but --server go above the environment's. They live as long as the app.
void AddServerOptions(CLI::App& app, std::string* server, client::Credentials* credentials);

// Whether the word is such an option, which takes the next word.
bool IsServerOption(std::string_view word);

// `given` over what the environment says.
client::Credentials ChooseCredentials(client::Credentials given,
                                      const client::Environment& environment);

}  // namespace voxeld::voxelctl
