#include <algorithm>
#include <cmath>
#include <filesystem>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "common/text/printable.h"
#include "daemon/text/stroke_font.h"
#include "display/sync/clock.h"
#include "tools/voxelctl/commands/captured_volume.h"
#include "tools/voxelctl/commands/commands.h"
#include "tools/voxelctl/commands/end_patterns.h"
#include "tools/voxelctl/commands/own_layer.h"
#include "tools/voxelctl/commands/put_shapes.h"
#include "tools/voxelctl/render/label.h"
#include "tools/voxelctl/render/palette.h"
#include "tools/voxelctl/render/png_file.h"
#include "tools/voxelctl/render/render_volume.h"
#include "tools/voxelctl/shape/drawing.h"
#include "tools/voxelctl/shape/examples.h"
#include "tools/voxelctl/text/proto_json.h"
#include "tools/voxelctl/text/table.h"

namespace voxeld::voxelctl {
namespace {

constexpr int kTile = 320, kMargin = 12;
constexpr double kLetters = 13;
constexpr int kEachWidth = 240, kEachHeight = 200, kEachColors = 64;
constexpr ViewAngles kAngles = {24, 20};

// Captures the first volume that shows this snapshot, or any.
absl::StatusOr<Volume> Capture(const GalleryOptions& options, uint64_t snapshot,
                               Connection& connection) {
  v1::CaptureVolumeRequest request;
  request.set_name(options.display);
  request.set_timeout_ns(10 * sync::kSecond);
  request.set_at_least_snapshot(snapshot);
  CapturedVolume captured;
  absl::Status status = connection.CaptureVolume(
      request, [&](const v1::VolumeChunk& chunk) { return captured.Add(chunk); });
  if (!status.ok()) return status;
  return std::move(captured).Finish();
}

// Removes what earlier commands have drawn, as far as the caller may.
absl::Status Empty(Connection& connection) {
  const absl::StatusOr<std::vector<OwnedLayer>> layers = DrawnBefore(connection);
  if (!layers.ok()) return layers.status();
  return TakeDown(*layers, connection).status();
}

// Returns the other layers in the scene, which therefore appear in every picture.
absl::StatusOr<std::vector<std::string>> Beside(Connection& connection) {
  const absl::StatusOr<v1::ListEntitiesResponse> all =
      connection.ListEntities({}, /*first_page_only=*/true);
  if (!all.ok()) return all.status();
  std::vector<std::string> beside;
  for (const v1::LayerInfo& layer : all->layers()) {
    if (!layer.visible() || layer.opacity() == 0 || layer.entities() == 0) continue;
    beside.push_back(
        absl::StrCat("\"", EscapeForTerminal(layer.layer()), "\" of owner ", layer.owner()));
  }
  return beside;
}

std::string BesideForTerminal(std::vector<std::string> layers) {
  constexpr size_t kMostNamed = 3;
  const size_t count = layers.size();
  if (count > kMostNamed) layers.resize(kMostNamed);
  return absl::StrCat("the pictures show what others have up too: ", absl::StrJoin(layers, ", "),
                      count > kMostNamed ? absl::StrCat(" and ", count - kMostNamed, " more") : "",
                      "; without it: voxelctl clear --all, which takes the scope control");
}

// Converts a name to a file name: "points, soft" is points-soft.png.
std::string FileName(absl::string_view name) {
  std::string out;
  for (const char c : name) {
    if (absl::ascii_isalnum(static_cast<unsigned char>(c)) || c == '_') {
      out += absl::ascii_tolower(static_cast<unsigned char>(c));
    } else if (!out.empty() && out.back() != '-') {
      out += '-';
    }
  }
  return out + ".png";
}

// Writes the picture of one shape, without a label.
absl::Status WriteEach(const std::string& folder, const char* name, const Volume& volume) {
  const Image image =
      RenderVolume(volume, {.width = kEachWidth, .height = kEachHeight, .angles = kAngles});
  return WritePalettePng(std::filesystem::path(folder) / FileName(name),
                         ReduceColors(image, kEachColors));
}

// Fills the sheet with the tile's background.
void Cover(const Image& tile, Image& sheet) {
  for (size_t i = 0; i < sheet.rgb.size(); ++i) sheet.rgb[i] = tile.rgb[i % 3];
}

void Paste(const Image& tile, int left, int top, Image& sheet) {
  for (int v = 0; v < tile.height; ++v) {
    const uint8_t* const from =
        &tile.rgb[static_cast<size_t>(v) * static_cast<size_t>(tile.width) * 3];
    const size_t to = (static_cast<size_t>(top + v) * static_cast<size_t>(sheet.width) +
                       static_cast<size_t>(left)) *
                      3;
    std::copy(from, from + static_cast<size_t>(tile.width) * 3,
              sheet.rgb.begin() + static_cast<ptrdiff_t>(to));
  }
}

}  // namespace

absl::Status Gallery(const GalleryOptions& options, Connection& connection, Interrupt& interrupt,
                     Console& console) {
  const absl::StatusOr<text::StrokeFont> font = text::StrokeFont::Load("futural");
  if (!font.ok()) return font.status();
  if (!options.each.empty()) {
    std::error_code error;
    std::filesystem::create_directories(options.each, error);
    if (error) {
      return absl::PermissionDeniedError(absl::StrCat(
          EscapeForTerminal(options.each), ": no folder can be made there: ", error.message()));
    }
  }
  const std::span<const ShapeExample> examples = ShapeExamples();
  const int columns = static_cast<int>(std::ceil(std::sqrt(static_cast<double>(examples.size()))));
  const int rows = (static_cast<int>(examples.size()) + columns - 1) / columns;
  Image sheet{columns * kTile, rows * kTile, {}};
  sheet.rgb.resize(static_cast<size_t>(sheet.width) * static_cast<size_t>(sheet.height) * 3);
  const absl::StatusOr<EndedPatterns> patterns = EndPatterns(connection);
  if (!patterns.ok()) return patterns.status();
  if (absl::Status status = Empty(connection); !status.ok()) return status;
  const absl::StatusOr<std::vector<std::string>> beside = Beside(connection);
  if (!beside.ok()) return beside.status();
  for (size_t i = 0; i < examples.size(); ++i) {
    if (interrupt.requested()) return absl::CancelledError("interrupted");
    console.ProgressBar("drawing", static_cast<double>(i) / static_cast<double>(examples.size()),
                        examples[i].name);
    const std::vector<std::string> shapes = absl::StrSplit(examples[i].text, '\n');
    const absl::StatusOr<v1::ApplyUpdateRequest> request = ShapesRequest(shapes);
    if (!request.ok()) return request.status();
    const absl::StatusOr<ShapesPut> put = PutShapes(*request, /*add=*/true, connection);
    if (!put.ok()) return put.status();
    const absl::StatusOr<Volume> volume = Capture(options, put->snapshot, connection);
    if (!volume.ok()) return volume.status();
    Image tile = RenderVolume(*volume, {.width = kTile, .height = kTile, .angles = kAngles});
    DrawLabel(*font, examples[i].name, kMargin, kMargin + kLetters, kLetters, tile);
    if (i == 0) Cover(tile, sheet);
    Paste(tile, static_cast<int>(i) % columns * kTile, static_cast<int>(i) / columns * kTile,
          sheet);
    if (!options.each.empty()) {
      const absl::Status status = WriteEach(options.each, examples[i].name, *volume);
      if (!status.ok()) return status;
    }
    if (absl::Status status = Empty(connection); !status.ok()) return status;
  }
  if (absl::Status status = WritePng(options.file, sheet); !status.ok()) return status;
  if (console.json()) {
    console.Data(JsonText({{"file", options.file},
                           {"shapes", examples.size()},
                           {"width", sheet.width},
                           {"height", sheet.height},
                           {"beside", *beside}},
                          false));
    return absl::OkStatus();
  }
  if (!beside->empty()) console.Say(BesideForTerminal(*beside));
  if (!patterns->stay.empty()) console.Say(PatternsStay(*patterns));
  console.Say(absl::StrCat(EscapeForTerminal(options.file), ": ", sheet.width, "x", sheet.height,
                           ", ", Counted(examples.size(), "shape"),
                           ", each decoded from what the display was sent"));
  return absl::OkStatus();
}

}  // namespace voxeld::voxelctl
