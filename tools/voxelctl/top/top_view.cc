#include "tools/voxelctl/top/top_view.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "absl/strings/strip.h"
#include "common/text/printable.h"
#include "tools/voxelctl/text/table.h"
#include "tools/voxelctl/text/troubles.h"

namespace voxeld::voxelctl {
namespace {

using Align = Table::Align;

constexpr int kBar = 24;
constexpr const char* kKeys = "q quit   p pause   tab, arrows: another display";

std::string State(const v1::DisplayStats& display) {
  return absl::AsciiStrToLower(
      absl::StripPrefix(v1::DisplayState_Name(display.state()), "DISPLAY_STATE_"));
}

TopStyle StyleOf(const v1::DisplayStats& display) {
  if (!display.engine_degraded().empty() || display.volume_held()) return TopStyle::kWarning;
  return display.state() == v1::DISPLAY_STATE_SHOWING ? TopStyle::kGood : TopStyle::kBad;
}

// Truncates to the columns that fit; one code point is one column.
std::string Cut(const std::string& text, int width) {
  int columns = 0;
  for (size_t i = 0; i < text.size(); ++i) {
    if ((text[i] & 0xc0) != 0x80 && columns++ == width) return text.substr(0, i);
  }
  return text;
}

std::string Marks(double share) {
  return std::string(static_cast<size_t>(std::lround(std::clamp(share, 0.0, 1.0) * kBar)), '#');
}

std::string Bar(double share) {
  const std::string filled = Marks(share);
  return absl::StrCat("[", filled, std::string(kBar - filled.size(), '.'), "]");
}

// Adds a table's heading and rows, each with its style.
void AddTable(const Table& table, const std::vector<TopStyle>& styles, std::vector<TopLine>* out) {
  size_t row = 0;
  for (const absl::string_view line : absl::StrSplit(table.Text(), '\n', absl::SkipEmpty())) {
    out->push_back({std::string(line), row == 0                  ? TopStyle::kHeading
                                       : row - 1 < styles.size() ? styles[row - 1]
                                                                 : TopStyle::kPlain});
    ++row;
  }
}

Table DisplayTable(const v1::Stats& stats, const std::string& chosen) {
  Table table({{" DISPLAY"},
               {"STATE"},
               {"ENGINE"},
               {"VOLUMES/s", Align::kRight},
               {"p50", Align::kRight},
               {"p99", Align::kRight},
               {"PRESENTED", Align::kRight},
               {"SUPERSEDED", Align::kRight},
               {"LOST", Align::kRight}});
  for (const v1::DisplayStats& d : stats.displays()) {
    table.Add({absl::StrCat(d.name() == chosen ? ">" : " ", d.name()), State(d), d.engine(),
               absl::StrFormat("%.1f", d.volumes_per_second()),
               Duration(d.commit_to_last_byte().p50_ns()),
               Duration(d.commit_to_last_byte().p99_ns()), Grouped(d.commits_presented()),
               Grouped(d.commits_superseded()), Grouped(d.commits_lost())});
  }
  return table;
}

Table OwnerTable(const v1::ListOwnersResponse& owners) {
  Table table({{"OWNER", Align::kRight},
               {"CLIENT"},
               {"SESSIONS", Align::kRight},
               {"LAYERS", Align::kRight},
               {"ENTITIES", Align::kRight},
               {"BYTES", Align::kRight}});
  for (const v1::OwnerInfo& owner : owners.owners()) {
    std::string names = absl::StrJoin(owner.client_names(), ", ");
    if (!owner.principal().empty()) names = absl::StrCat(owner.principal(), ": ", names);
    if (owner.hidden()) names += " (hidden)";
    table.Add({absl::StrCat(owner.owner()), names, Grouped(owner.sessions()),
               Grouped(owner.layers()), Grouped(owner.entities()), Bytes(owner.bytes())});
  }
  return table;
}

uint64_t Used(const v1::MemoryUse& memory) {
  return memory.scene_bytes() + memory.staged_bytes() + memory.waiting_bytes() +
         memory.answers_bytes() + memory.owed_bytes() + memory.engine_bytes() +
         memory.local_bytes() + memory.arriving_bytes();
}

std::string MemoryText(const v1::MemoryUse& memory) {
  std::vector<std::string> parts;
  for (const auto& [name, bytes] : {std::pair("scene", memory.scene_bytes()),
                                    {"engines", memory.engine_bytes()},
                                    {"staged", memory.staged_bytes()},
                                    {"waiting", memory.waiting_bytes()},
                                    {"answers", memory.answers_bytes()},
                                    {"owed", memory.owed_bytes()},
                                    {"local", memory.local_bytes()},
                                    {"arriving", memory.arriving_bytes()}}) {
    if (bytes > 0) parts.push_back(absl::StrCat(name, " ", Bytes(bytes)));
  }
  return absl::StrJoin(parts, ", ");
}

uint64_t Refused(const v1::ConnectionStats& c) {
  return c.refused_in_all() + c.refused_by_address() + c.refused_after_cut();
}

uint64_t CutOff(const v1::ConnectionStats& c) {
  return c.cut_for_bytes() + c.cut_for_time() + c.cut_for_cancelling() + c.cut_for_greeting() +
         c.cut_for_flooding() + c.cut_for_room();
}

std::string ConnectionText(const v1::ConnectionStats& c) {
  return absl::StrCat(Grouped(c.open()), " open, ", Grouped(c.accepted()), " accepted, ",
                      Grouped(Refused(c)), " refused, ", Grouped(CutOff(c)), " cut, ",
                      Grouped(c.calls_turned_away()), " calls turned away");
}

}  // namespace

void TopView::Take(const v1::Stats& stats, const v1::ListOwnersResponse& owners,
                   const std::string& owners_trouble) {
  lost_.clear();
  if (paused_) return;
  before_ = any_ ? stats_ : stats;
  stats_ = stats;
  owners_ = owners;
  owners_trouble_ = owners_trouble;
  any_ = true;
}

void TopView::Lose(const std::string& why) { lost_ = why; }

const v1::DisplayStats* TopView::Chosen() const {
  for (const v1::DisplayStats& display : stats_.displays()) {
    if (display.name() == chosen_) return &display;
  }
  return stats_.displays().empty() ? nullptr : &stats_.displays(0);
}

void TopView::Choose(int step) {
  const int count = stats_.displays_size();
  if (count == 0) return;
  const v1::DisplayStats* now = Chosen();
  int place = 0;
  while (&stats_.displays(place) != now) ++place;
  chosen_ = stats_.displays(((place + step) % count + count) % count).name();
}

double TopView::Rate(uint64_t now, uint64_t before) const {
  const double seconds = static_cast<double>(stats_.time_ns() - before_.time_ns()) / 1e9;
  return seconds > 0 && now > before ? static_cast<double>(now - before) / seconds : 0;
}

void TopView::AddServer(std::vector<TopLine>* out) const {
  out->push_back(
      {absl::StrCat("voxeld ", EscapeForTerminal(stats_.version()), ", up ",
                    Duration(stats_.uptime_ns()), ": ", Counted(stats_.sessions(), "session"), ", ",
                    Counted(stats_.layers(), "layer"), ", ",
                    Counted(stats_.entities(), "entity", "entities"), ", ",
                    Counted(stats_.objects(), "object"), paused_ ? "   PAUSED (p goes on)" : ""),
       TopStyle::kTitle});
  if (!lost_.empty()) out->push_back({absl::StrCat("nothing comes: ", lost_), TopStyle::kBad});
  const uint64_t refused = stats_.commits_refused();
  out->push_back(
      {absl::StrFormat("commits %.1f/s of %s accepted, %s refused; %s/s in",
                       Rate(stats_.commits_accepted(), before_.commits_accepted()),
                       Grouped(stats_.commits_accepted()), Grouped(refused),
                       Bytes(static_cast<uint64_t>(Rate(stats_.bytes_in(), before_.bytes_in())))),
       refused > before_.commits_refused() ? TopStyle::kWarning : TopStyle::kPlain});
}

void TopView::AddDisplays(std::vector<TopLine>* out) const {
  out->push_back({});
  const v1::DisplayStats* chosen = Chosen();
  if (chosen == nullptr) {
    out->push_back({"the server has no display", TopStyle::kWarning});
    return;
  }
  std::vector<TopStyle> styles;
  for (const v1::DisplayStats& display : stats_.displays()) {
    const TopStyle style = StyleOf(display);
    styles.push_back(&display == chosen && style == TopStyle::kGood ? TopStyle::kChosen : style);
  }
  AddTable(DisplayTable(stats_, chosen->name()), styles, out);
}

void TopView::AddStages(std::vector<TopLine>* out) const {
  const v1::DisplayStats* display = Chosen();
  if (display == nullptr) return;
  out->push_back({});
  const std::string name = EscapeForTerminal(display->name());
  if (display->state() != v1::DISPLAY_STATE_SHOWING) {
    out->push_back(
        {absl::StrCat(name, ": ", EscapeForTerminal(display->state_reason())), TopStyle::kBad});
  }
  if (!display->engine_degraded().empty()) {
    out->push_back({absl::StrCat(name, ": ", EscapeForTerminal(display->engine_degraded())),
                    TopStyle::kWarning});
  }
  Table table({{absl::StrCat("LATENCY of ", name)},
               {"p50", Align::kRight},
               {"p99", Align::kRight},
               {"longest", Align::kRight},
               {"", Align::kLeft}});
  const std::pair<const char*, const v1::Latency*> stages[] = {
      {"sending", &stats_.sending()},
      {"decoding", &stats_.decoding()},
      {"applying", &stats_.applying()},
      {"waiting", &display->waiting()},
      {"assembling", &display->assemble()},
      {display->packed_as_drawn() ? "slicing (as drawn)" : "slicing", &display->slice()},
      {"copying", &display->copy()},
      {"transferring", &display->transferring()},
      {"showing", &display->showing()},
      {"commit to last byte", &display->commit_to_last_byte()},
      {"commit to presented", &display->commit_to_presented()}};
  int64_t most = 1;
  for (const auto& [stage, latency] : stages) most = std::max(most, latency->p50_ns());
  for (const auto& [stage, latency] : stages) {
    const double share = static_cast<double>(latency->p50_ns()) / static_cast<double>(most);
    table.Add({stage, Duration(latency->p50_ns()), Duration(latency->p99_ns()),
               Duration(latency->max_ns()), Marks(share)});
  }
  AddTable(table, {}, out);
}

void TopView::AddMemory(std::vector<TopLine>* out) const {
  const v1::MemoryUse& memory = stats_.memory();
  const uint64_t used = Used(memory), limit = memory.limit_bytes();
  const double share = limit > 0 ? static_cast<double>(used) / static_cast<double>(limit) : 0;
  out->push_back({});
  out->push_back({absl::StrCat("MEMORY ", Bar(share), " ", Bytes(used), " of ", Bytes(limit), ": ",
                               MemoryText(memory)),
                  share > 0.9   ? TopStyle::kBad
                  : share > 0.7 ? TopStyle::kWarning
                                : TopStyle::kPlain});
}

void TopView::AddConnections(std::vector<TopLine>* out) const {
  const v1::ConnectionStats& c = stats_.connections();
  out->push_back(
      {absl::StrCat("CONNECTIONS ", ConnectionText(c)),
       Refused(c) + CutOff(c) > Refused(before_.connections()) + CutOff(before_.connections())
           ? TopStyle::kWarning
           : TopStyle::kPlain});
  for (std::string& trouble : Troubles(stats_)) {
    out->push_back({std::move(trouble), TopStyle::kWarning});
  }
}

void TopView::AddOwners(std::vector<TopLine>* out) const {
  out->push_back({});
  if (!owners_trouble_.empty()) {
    out->push_back({absl::StrCat("owners are not told: ", owners_trouble_), TopStyle::kWarning});
  } else if (owners_.owners().empty()) {
    out->push_back({"nobody owns anything", TopStyle::kFaint});
  } else {
    AddTable(OwnerTable(owners_), {}, out);
  }
}

std::vector<TopLine> TopView::Lines(int width, int height) const {
  std::vector<TopLine> out;
  if (any_) {
    AddServer(&out);
    AddDisplays(&out);
    AddStages(&out);
    AddMemory(&out);
    AddConnections(&out);
    AddOwners(&out);
  } else {
    out.push_back(
        {lost_.empty() ? "waiting for the server …" : absl::StrCat("nothing comes: ", lost_),
         lost_.empty() ? TopStyle::kPlain : TopStyle::kBad});
  }
  const auto room = static_cast<size_t>(std::max(height - 1, 0));  // the last line is for the keys
  std::string keys = kKeys;
  if (out.size() > room) {
    keys = absl::StrCat(kKeys, "   (", Counted(out.size() - room, "line"),
                        " more on a higher terminal)");
    out.resize(room);
  }
  out.resize(room);
  if (height > 0) out.push_back({keys, TopStyle::kFaint});
  for (TopLine& line : out) line.text = Cut(line.text, width);
  return out;
}

std::string TopText(const v1::Stats& stats, const v1::ListOwnersResponse& owners) {
  std::string text = DisplayTable(stats, "").Text();
  if (!owners.owners().empty()) absl::StrAppend(&text, OwnerTable(owners).Text());
  absl::StrAppend(&text, "memory ", Bytes(Used(stats.memory())), " of ",
                  Bytes(stats.memory().limit_bytes()), "; connections ",
                  ConnectionText(stats.connections()), "\n");
  for (const std::string& trouble : Troubles(stats)) absl::StrAppend(&text, trouble, "\n");
  return text;
}

}  // namespace voxeld::voxelctl
