#include "daemon/viewer/viewer_play.h"

#include <atomic>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "display/sync/mutex.h"

namespace voxeld::daemon::viewer {
namespace {

using Json = nlohmann::json;

constexpr size_t kLongestQueryName = 1024;
// Limit on tasks that wait for a disk; each upload adds at most two. Beyond it uploads are
// rejected.
constexpr size_t kMostWaiting = 16;

http::Response Said(unsigned status, absl::string_view text) {
  return {status, "text/plain; charset=utf-8", absl::StrCat(text, "\n"), {}};
}

http::Reception Refuse(unsigned status, absl::string_view why) {
  http::Reception reception;
  reception.refusal = Said(status, why);
  return reception;
}

// Returns: nothing if the text is not valid percent-encoding.
std::optional<std::string> PercentDecoded(std::string_view text) {
  std::string out;
  for (size_t i = 0; i < text.size(); ++i) {
    if (text[i] != '%') {
      out += text[i];
      continue;
    }
    if (i + 2 >= text.size() || !absl::ascii_isxdigit(static_cast<unsigned char>(text[i + 1])) ||
        !absl::ascii_isxdigit(static_cast<unsigned char>(text[i + 2]))) {
      return std::nullopt;
    }
    out += absl::HexStringToBytes(absl::string_view(text.data() + i + 1, 2));
    i += 2;
  }
  return out;
}

// The file during an upload, shared by the upload and the worker's tasks.
struct Held {
  std::optional<play::PlayFile> file;  // used by the worker
  std::atomic<bool> given_up = false;  // the upload was aborted
};

}  // namespace

// The pages to notify. Thread-safe.
class ViewerPlay::Pages {
 public:
  explicit Pages(const ViewerPlayOptions& options)
      : player_(options.player), why_not_(options.why_not), max_bytes_(options.max_bytes) {}

  void Join(const std::shared_ptr<http::WebSocketPeer>& page) {
    const sync::MutexLock lock(mutex_);
    std::erase_if(pages_, [&page](const std::weak_ptr<http::WebSocketPeer>& other) {
      const auto open = other.lock();
      return open == nullptr || open == page;
    });
    pages_.push_back(page);
    page->Send(Message(), false);
  }

  void Tell() {
    // Notify under the lock, so that the newest state is sent last.
    const sync::MutexLock lock(mutex_);
    const std::string message = Message();
    std::erase_if(pages_, [&message](const std::weak_ptr<http::WebSocketPeer>& page) {
      const auto open = page.lock();
      if (open != nullptr) open->Send(message, false);
      return open == nullptr;
    });
  }

 private:
  std::string Message() const {
    Json what = Json::object();
    if (player_ == nullptr) {
      what["why_not"] = why_not_;
    } else {
      const play::Playing state = player_->state();
      what["max_bytes"] = max_bytes_;
      if (!state.name.empty()) what["playing"] = state.name;
      if (!state.failed.empty()) what["failed"] = state.failed;
      if (!state.why.empty()) what["why"] = state.why;
    }
    return Json{{"play", std::move(what)}}.dump(-1, ' ', false, Json::error_handler_t::replace);
  }

  play::Player* const player_;
  const std::string why_not_;
  const uint64_t max_bytes_;
  sync::Mutex mutex_;
  std::vector<std::weak_ptr<http::WebSocketPeer>> pages_ VOXELD_GUARDED_BY(mutex_);
};

// Receives an upload and writes it on the worker; while it exists other uploads are rejected. Its
// destructor cancels tasks that have not started.
class ViewerPlay::Upload final : public http::BodyReceiver {
 public:
  Upload(std::shared_ptr<ViewerPlay> play, std::string name)
      : play_(std::move(play)), name_(std::move(name)) {
    play_->taking_ = true;
  }
  ~Upload() override {
    play_->taking_ = false;
    if (held_ == nullptr) return;
    held_->given_up = true;
    // The worker also removes the file, because that may block. If it has no thread, there is no
    // file.
    (void)play_->worker_.Post([held = std::move(held_)] { held->file.reset(); });
  }

  void Take(std::string piece, std::function<void(std::optional<http::Response>)> then) override {
    if (held_ == nullptr) held_ = std::make_shared<Held>();
    const absl::Status posted =
        play_->worker_.Post([held = held_, name = name_, write = play_->options_.write,
                             piece = std::move(piece), then] {
          if (held->given_up) return;
          absl::Status status;
          if (!held->file.has_value()) {
            absl::StatusOr<play::PlayFile> made = play::PlayFile::Make(name, write);
            status = made.status();
            if (status.ok()) held->file.emplace(*std::move(made));
          }
          if (status.ok()) status = held->file->Append(piece);
          if (status.ok()) return then(std::nullopt);
          then(Said(absl::IsResourceExhausted(status) ? 507 : 500, status.message()));
        });
    if (!posted.ok()) then(Said(503, posted.message()));
  }

  void Whole(http::Done done) override {
    if (held_ == nullptr) return done(Said(400, "the file is empty"));
    if (play_->audit_ != nullptr) {
      if (const absl::Status may = play_->audit_->MayAct(); !may.ok()) {
        play_->Record("Play", absl::StrCat("name=\"", absl::CHexEscape(name_), "\""), may);
        return done(Said(503, may.message()));
      }
    }
    // Every piece has been written, so the file and the thread exist.
    (void)play_->worker_.Post([held = held_, play = play_.get(), done] {
      if (held->given_up) return;
      play->Record("Play", absl::StrCat("name=\"", absl::CHexEscape(held->file->name()),
                                        "\" bytes=", held->file->bytes()));
      play->options_.player->Play(*std::move(held->file));
      held->file.reset();
      done(Said(202, "it is being played"));
    });
  }

 private:
  const std::shared_ptr<ViewerPlay> play_;
  const std::string name_;
  std::shared_ptr<Held> held_;  // null before the first piece
};

ViewerPlay::ViewerPlay(ViewerPlayOptions options, access::Audit* audit)
    : options_(std::move(options)), audit_(audit), pages_(std::make_shared<Pages>(options_)) {}

std::shared_ptr<ViewerPlay> ViewerPlay::Make(ViewerPlayOptions options, access::Audit* audit) {
  std::shared_ptr<ViewerPlay> play(new ViewerPlay(std::move(options), audit));
  play->self_ = play;
  if (play->options_.player != nullptr) {
    play->options_.player->SetOnChange([pages = play->pages_] { pages->Tell(); });
  }
  return play;
}

ViewerPlay::~ViewerPlay() {
  if (options_.player != nullptr) options_.player->SetOnChange(nullptr);
}

http::Reception ViewerPlay::Receive(std::string_view query) {
  if (options_.player == nullptr) return Refuse(503, options_.why_not);
  std::optional<std::string> name;
  for (const absl::string_view part :
       absl::StrSplit(absl::string_view(query.data(), query.size()), '&')) {
    if (part.substr(0, 5) == "name=" && part.size() <= kLongestQueryName) {
      name = PercentDecoded(std::string_view(part.data() + 5, part.size() - 5));
    }
  }
  if (!name.has_value() || name->empty()) {
    return Refuse(400,
                  "the file's name is expected, percent-encoded, as in /play?name=teapot.obj: its "
                  "extension says what it is");
  }
  if (taking_) return Refuse(409, "another file is being sent; try again when that is done");
  if (worker_.waiting() >= kMostWaiting) {
    return Refuse(503,
                  "the disk that files are kept on while they play does not answer; free it, or "
                  "start voxeld with another TMPDIR");
  }
  http::Reception reception;
  reception.max_bytes = options_.max_bytes;
  reception.receiver = std::make_unique<Upload>(self_.lock(), *std::move(name));
  return reception;
}

void ViewerPlay::Join(const std::shared_ptr<http::WebSocketPeer>& page) { pages_->Join(page); }

void ViewerPlay::Stop() {
  if (options_.player == nullptr) return;
  Record("StopPlaying",
         absl::StrCat("name=\"", absl::CHexEscape(options_.player->state().name), "\""));
  options_.player->Stop();
}

void ViewerPlay::Record(const char* method, const std::string& what,
                        const absl::Status& result) const {
  if (audit_ != nullptr) audit_->Record("page", "http", method, what, result);
}

}  // namespace voxeld::daemon::viewer
