#include <cerrno>
#include <fstream>
#include <iterator>
#include <string>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "common/text/printable.h"
#include "nlohmann/json.hpp"
#include "tools/voxelctl/commands/commands.h"
#include "tools/voxelctl/text/table.h"

namespace voxeld::voxelctl {
namespace {

absl::Status List(Connection& connection, Console& console) {
  const absl::StatusOr<v1::ListAssetsResponse> answer = connection.ListAssets();
  if (!answer.ok()) return answer.status();
  if (console.json()) {
    nlohmann::ordered_json assets = nlohmann::ordered_json::array();
    for (const v1::AssetInfo& asset : answer->assets()) {
      assets.push_back({{"sha256", absl::BytesToHexString(asset.sha256())},
                        {"stored", asset.stored()},
                        {"complete", asset.complete()}});
    }
    const nlohmann::ordered_json all = {{"assets", assets}, {"used_bytes", answer->used_bytes()}};
    console.Data(all.dump(2) + "\n");
    return absl::OkStatus();
  }
  Table table({{"SHA-256"}, {"SIZE", Table::Align::kRight}, {"STATE"}});
  for (const v1::AssetInfo& asset : answer->assets()) {
    table.Add({absl::BytesToHexString(asset.sha256()), Bytes(asset.stored()),
               asset.complete() ? "whole" : "not whole"});
  }
  console.Data(absl::StrCat(answer->assets_size() == 0 ? "no assets\n" : table.Text()));
  return absl::OkStatus();
}

absl::StatusOr<std::string> Read(const std::string& path) {
  errno = 0;
  std::ifstream file(path, std::ios::binary);
  std::string bytes{std::istreambuf_iterator<char>(file), {}};
  if (!file.is_open() || file.bad() || errno != 0) {
    return absl::ErrnoToStatus(errno == 0 ? EIO : errno,
                               absl::StrCat("\"", EscapeForTerminal(path), "\" cannot be read"));
  }
  return bytes;
}

}  // namespace

absl::Status Assets(const AssetsOptions& options, Connection& connection, Interrupt& interrupt,
                    Console& console) {
  if (options.files.empty()) return List(connection, console);
  for (const std::string& path : options.files) {
    const absl::StatusOr<std::string> bytes = Read(path);
    if (!bytes.ok()) return bytes.status();
    const std::string name = EscapeForTerminal(path);
    const auto asset = connection.UploadAsset(*bytes, [&](uint64_t stored, uint64_t size) {
      console.ProgressBar(name, static_cast<double>(stored) / static_cast<double>(size),
                          absl::StrCat(Bytes(stored), " of ", Bytes(size)));
      return !interrupt.requested();
    });
    console.EndProgress();
    if (!asset.ok()) {
      return absl::Status(asset.status().code(),
                          absl::StrCat("\"", name, "\": ", asset.status().message()));
    }
    const std::string digest = absl::BytesToHexString(asset->sha256);
    if (console.json()) {
      console.Data(
          nlohmann::ordered_json{{"file", path}, {"sha256", digest}, {"size", asset->size}}.dump(
              -1, ' ', false, nlohmann::ordered_json::error_handler_t::replace) +
          "\n");
    } else {
      console.Data(absl::StrCat(digest, "  ", name, "\n"));
    }
  }
  return absl::OkStatus();
}

}  // namespace voxeld::voxelctl
