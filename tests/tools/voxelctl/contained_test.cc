// Tests reading in a process of its own: the results, and what the reader cannot do.
#include "tools/voxelctl/import/contained.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <linux/openat2.h>
#include <poll.h>
#include <seccomp.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cmath>
#include <csignal>
#include <cstdlib>
#include <fstream>
#include <functional>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "tests/tools/voxelctl/status_matchers.h"
#include "tests/tools/voxelctl/temp_folder.h"
#include "tools/voxelctl/import/importer.h"
#include "tools/voxelctl/import/model_bytes.h"
#include "tools/voxelctl/import/reader_process.h"
#include "tools/voxelctl/import/sandbox.h"

namespace voxeld::voxelctl {
namespace contained_test {

using ::testing::HasSubstr;

absl::StatusOr<Model> ReadApart(SourceFile file, const std::function<absl::StatusOr<Model>()>& read,
                                Interrupt* interrupt = nullptr, const ReaderLimits& limits = {}) {
  return ReadContained(file, ReaderOf(file, read), interrupt, limits);
}

absl::StatusOr<std::unique_ptr<FrameSource>> OpenApart(const SourceFile& file,
                                                       const OpenFrames& open,
                                                       Interrupt* interrupt = nullptr,
                                                       const ReaderLimits& limits = {}) {
  return OpenContained(file, FramesOf(file, open), interrupt, limits);
}

[[noreturn]] void RunForEver() {
  for (volatile bool always = true; always;) {
  }
  ::_exit(1);
}

TEST(Contained, ModelsComeBackAsTheyWere) {
  Model model;
  model.format = "kind";
  model.note = "a note";
  model.up = Up::kX;
  model.parts.push_back({.kind = Kind::kSegments,
                         .positions = {{1, 2, 3}, {4, 5, 6}},
                         .normals = {{0, 0, 1}, {0, 1, 0}},
                         .colors = {{1, 2, 3}, {4, 5, 6}},
                         .indices = {0, 1},
                         .thickness = 0.5,
                         .attributes = {{"height", {1, 2}}, {"none", {7, 8}}}});
  model.parts.push_back({.kind = Kind::kTriangles,
                         .positions = {{1, 2, 3}, {4, 5, 6}, {7, 8, 9}},
                         .indices = {0, 1, 2},
                         .texture_coordinates = {{0, 0}, {1, 0}, {0, 1}},
                         .picture = 1});
  model.pictures = {"first", "second"};
  model.left_out = {{"cameras", 2}, {"lights", 1}};
  model.path = "p";
  model.lit_already = true;
  SampledVolume& numbers = model.volumes.emplace_back();
  numbers.size = {1, 1, 2};
  numbers.samples = {3, 4};
  numbers.corners[7] = {7, 8, 9};
  SampledVolume& colors = model.volumes.emplace_back();
  colors.size = {1, 1, 1};
  colors.samples = {1};
  colors.colors = {{1, 2, 3}};
  colors.window = {5, 6};
  const auto back = ReadApart({.path = "p"}, [&model] { return model; });
  ASSERT_THAT(back, IsOk());
  EXPECT_EQ(back->path, "p");
  EXPECT_EQ(back->format, "kind");
  EXPECT_EQ(back->note, "a note");
  EXPECT_EQ(back->up, Up::kX);
  EXPECT_EQ(back->left_out, model.left_out);
  EXPECT_EQ(NoteOf(*back), "p: a note; left out: cameras (2), lights (1)");
  EXPECT_EQ(back->pictures, model.pictures);
  ASSERT_EQ(back->parts.size(), 2u);
  EXPECT_EQ(back->parts[1].picture, 1u);
  EXPECT_EQ(back->parts[1].texture_coordinates, model.parts[1].texture_coordinates);
  ASSERT_EQ(back->parts[0].attributes.size(), 2u);
  EXPECT_EQ(back->parts[0].attributes[1].name, "none");
  EXPECT_EQ(back->parts[0].attributes[1].values, (std::vector<double>{7, 8}));
  EXPECT_EQ(back->parts[0].kind, Kind::kSegments);
  EXPECT_EQ(back->parts[0].positions, model.parts[0].positions);
  EXPECT_EQ(back->parts[0].normals, model.parts[0].normals);
  EXPECT_EQ(back->parts[0].colors, model.parts[0].colors);
  EXPECT_EQ(back->parts[0].indices, model.parts[0].indices);
  EXPECT_EQ(back->parts[0].thickness, 0.5);
  EXPECT_TRUE(back->lit_already);
  ASSERT_EQ(back->volumes.size(), 2u);
  EXPECT_EQ(back->volumes[0].size, (std::array<uint32_t, 3>{1, 1, 2}));
  EXPECT_EQ(back->volumes[0].samples, (std::vector<float>{3, 4}));
  EXPECT_EQ(back->volumes[0].corners[7], (Point3{7, 8, 9}));
  EXPECT_EQ(back->volumes[0].window, std::nullopt);
  EXPECT_EQ(back->volumes[1].window, (std::array<double, 2>{5, 6}));
  EXPECT_EQ(back->volumes[1].colors, (std::vector<Rgb>{{1, 2, 3}}));
}

TEST(Contained, WhatGoesWrongIsSaid) {
  const auto error = [](const std::function<absl::StatusOr<Model>()>& read) {
    return std::string(ReadApart({.path = "p"}, read).status().message());
  };
  EXPECT_EQ(error([] { return absl::InvalidArgumentError("p: so it is"); }), "p: so it is");
  EXPECT_THAT(error([]() -> absl::StatusOr<Model> {
                *static_cast<volatile int*>(nullptr) = 1;
                return Model();
              }),
              HasSubstr("p: the library that reads it crashed"));
  EXPECT_THAT(error([]() -> absl::StatusOr<Model> { std::abort(); }), HasSubstr("crashed"));
}

// A compromised reader can send models that no correct reader makes.
TEST(Contained, ModelsThatAreNotSoundAreRefused) {
  const auto refused = [](const std::function<void(Model&)>& spoil) {
    Model model;
    model.path = "p";
    model.parts.push_back({.kind = Kind::kTriangles,
                           .positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}},
                           .normals = std::vector<Point3>(3),
                           .colors = std::vector<Rgb>(3),
                           .indices = {0, 1, 2}});
    SampledVolume& volume = model.volumes.emplace_back();
    volume.size = {1, 2, 2};
    volume.samples = {1, 2, 3, 4};
    spoil(model);
    return !CheckModel({.path = "p"}, model).ok();
  };
  EXPECT_FALSE(refused([](Model&) {}));
  EXPECT_TRUE(refused([](Model& m) { m.parts[0].colors.pop_back(); }));
  EXPECT_TRUE(refused([](Model& m) { m.parts[0].normals.pop_back(); }));
  EXPECT_TRUE(refused([](Model& m) { m.parts[0].normals[1].x = std::nan(""); }));
  EXPECT_TRUE(refused([](Model& m) { m.parts[0].indices.pop_back(); }));
  EXPECT_TRUE(refused([](Model& m) { m.parts[0].indices[1] = 3; }));
  EXPECT_TRUE(refused([](Model& m) { m.parts[0].kind = Kind::kPoints; }));
  const auto with_picture = [](const std::function<void(Model&)>& spoil) {
    return [spoil](Model& m) {
      m.pictures = {"a picture"};
      m.parts[0].picture = 0;
      m.parts[0].texture_coordinates = {{0, 0}, {1, 0}, {0, 1}};
      m.parts[0].attributes = {{"a", {1, 2, std::nanf("")}}};
      spoil(m);
    };
  };
  EXPECT_FALSE(refused(with_picture([](Model&) {})));
  EXPECT_TRUE(refused(with_picture([](Model& m) { m.pictures.clear(); })));
  EXPECT_TRUE(refused(with_picture([](Model& m) { m.parts[0].picture = kNoPicture; })));
  EXPECT_TRUE(refused(with_picture([](Model& m) { m.parts[0].texture_coordinates.pop_back(); })));
  EXPECT_TRUE(
      refused(with_picture([](Model& m) { m.parts[0].texture_coordinates[2][1] = INFINITY; })));
  EXPECT_TRUE(refused(with_picture([](Model& m) { m.parts[0].attributes[0].values.pop_back(); })));
  EXPECT_TRUE(refused([](Model& m) { m.parts[0].thickness = HUGE_VAL; }));
  EXPECT_TRUE(refused([](Model& m) { m.volumes[0].corners[3].y = HUGE_VAL; }));
  // Their product is 4 modulo 2⁶⁴.
  EXPECT_TRUE(refused([](Model& m) { m.volumes[0].size = {968973220, 49477, 384773}; }));
}

// Returns the result of `act`, run as a reader of `file`: 0, or the error of the call that failed.
int ErrorOf(const SourceFile& file, const std::function<bool()>& act) {
  const auto model = ReadApart(file, [&act]() -> absl::StatusOr<Model> {
    Model told;
    errno = 0;
    told.note = std::to_string(act() ? 0 : errno);
    return told;
  });
  EXPECT_THAT(model, IsOk());
  return model.ok() ? std::atoi(model->note.c_str()) : -1;
}

bool Opens(const std::string& path, int flags = O_RDONLY) {
  const int file = ::open(path.c_str(), flags, 0600);
  if (file >= 0) ::close(file);
  return file >= 0;
}

class SandboxTest : public ::testing::Test {
 protected:
  SandboxTest() {
    ::mkdir(folder_.Path("own").c_str(), 0700);
    inside_ = folder_.Write("own/beside.txt", "x");
    outside_ = folder_.Write("outside.txt", "x");
    file_.path = folder_.Path("own/file.obj");
  }

  TempFolder folder_;
  std::string inside_, outside_;
  SourceFile file_;
};

TEST_F(SandboxTest, AStrangersFileOpensNothing) {
  file_.other_files = OtherFiles::kNone;
  for (const std::string& path : {inside_, outside_, std::string("/etc/passwd"), std::string("/"),
                                  std::string("/proc/self/environ")}) {
    EXPECT_EQ(ErrorOf(file_, [&] { return Opens(path); }), EACCES) << path;
  }
}

TEST_F(SandboxTest, AFileOfTheUsersOwnOpensWhatItsFolderHolds) {
  file_.other_files = OtherFiles::kBelow;
  EXPECT_EQ(ErrorOf(file_, [&] { return Opens(inside_); }), 0);
  EXPECT_EQ(ErrorOf(file_, [&] { return Opens(outside_); }), EACCES);
  EXPECT_EQ(::symlink(outside_.c_str(), folder_.Path("own/link").c_str()), 0);
  EXPECT_EQ(ErrorOf(file_, [&] { return Opens(folder_.Path("own/link")); }), EACCES);
  file_.other_files = OtherFiles::kAny;
  EXPECT_EQ(ErrorOf(file_, [&] { return Opens(outside_); }), 0);
}

TEST_F(SandboxTest, NothingIsWrittenRemovedOrStarted) {
  file_.other_files = OtherFiles::kAny;
  const pid_t parent = ::getpid();
  EXPECT_EQ(ErrorOf(file_, [&] { return Opens(inside_, O_WRONLY); }), EPERM);
  EXPECT_EQ(ErrorOf(file_, [&] { return Opens(folder_.Path("new"), O_CREAT | O_WRONLY); }), EPERM);
  EXPECT_EQ(ErrorOf(file_, [&] { return ::fcntl(STDIN_FILENO, F_SETOWN, parent) == 0; }), EPERM);
  EXPECT_EQ(ErrorOf(file_,
                    [&] {
                      open_how how = {};
                      how.flags = O_WRONLY;
                      return ::syscall(SYS_openat2, AT_FDCWD, inside_.c_str(), &how, sizeof(how)) >=
                             0;
                    }),
            EACCES)
      << "this is Landlock's";
  EXPECT_EQ(ErrorOf(file_, [&] { return ::unlink(inside_.c_str()) == 0; }), EPERM);
  EXPECT_EQ(ErrorOf(file_, [&] { return ::truncate(inside_.c_str(), 0) == 0; }), EPERM);
  EXPECT_EQ(ErrorOf(file_, [] { return ::execl("/bin/true", "true", nullptr) == 0; }), EPERM);
  EXPECT_EQ(ErrorOf(file_, [] { return ::fork() >= 0; }), EPERM);
  EXPECT_EQ(ErrorOf(file_, [] { return ::socket(AF_INET, SOCK_STREAM, 0) >= 0; }), EPERM);
  EXPECT_EQ(ErrorOf(file_, [] { return ::socket(AF_UNIX, SOCK_STREAM, 0) >= 0; }), EPERM);
  EXPECT_EQ(ErrorOf(file_, [&] { return ::kill(parent, 0) == 0; }), EPERM);
}

TEST_F(SandboxTest, ThreadsAreStartedAndAreAsConfined) {
  EXPECT_EQ(ErrorOf(file_,
                    [&] {
                      int error = 0;
                      std::thread([&] { error = Opens(outside_) ? 0 : errno; }).join();
                      errno = error;
                      return error == 0;
                    }),
            EACCES);
  EXPECT_EQ(ErrorOf(file_, [] { return ::vfork() >= 0; }), EPERM);
}

TEST_F(SandboxTest, TheReaderHasNoDescriptorOfThisProcess) {
  const int mine = ::fcntl(STDIN_FILENO, F_DUPFD_CLOEXEC, 10);
  ASSERT_GE(mine, 0);
  char byte = 0;
  EXPECT_EQ(ErrorOf(file_, [&] { return ::read(mine, &byte, 1) >= 0; }), EBADF);
  EXPECT_EQ(ErrorOf(file_, [&] { return ::read(STDIN_FILENO, &byte, 1) == 0; }), 0) << "/dev/null";
  ::close(mine);
}

TEST_F(SandboxTest, DescriptorsAreLimited) {
  EXPECT_EQ(ErrorOf(file_,
                    [&] {
                      for (int i = 0; i < 100; ++i) {
                        if (::open(inside_.c_str(), O_RDONLY) < 0) return false;
                      }
                      return true;
                    }),
            EMFILE);
}

// Denies Landlock to this process, as an old kernel or a service manager's filter does.
void WithoutLandlock() {
  ::prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0);
  const scmp_filter_ctx filter = seccomp_init(SCMP_ACT_ALLOW);
  seccomp_rule_add(filter, SCMP_ACT_ERRNO(ENOSYS), SCMP_SYS(landlock_create_ruleset), 0);
  if (seccomp_load(filter) != 0) ::_exit(98);
}

TEST_F(SandboxTest, WithoutLandlockAStrangersFileIsRefusedWithTheReason) {
  const auto read = [this](OtherFiles others) {
    file_.other_files = others;
    return ReadApart(file_, [] { return Model(); }).status();
  };
  EXPECT_EXIT(
      {
        WithoutLandlock();
        const absl::Status refused = read(OtherFiles::kNone);
        const bool says = absl::IsFailedPrecondition(refused) &&
                          refused.message().find("Landlock") != absl::string_view::npos;
        ::_exit(says && read(OtherFiles::kBelow).ok() ? 7 : 8);
      },
      ::testing::ExitedWithCode(7), "");
}

TEST(Contained, EndsWhenItIsInterrupted) {
  Interrupt interrupt(Interrupt::Watch::kNothing);
  std::thread later([&interrupt] { interrupt.Request(); });
  const absl::Status status =
      ReadApart(
          {.path = "p"}, []() -> absl::StatusOr<Model> { RunForEver(); }, &interrupt)
          .status();
  later.join();
  EXPECT_TRUE(absl::IsCancelled(status)) << status;
}

// Returns: the first child of `process`; 0 if it has none.
pid_t ChildOf(pid_t process) {
  std::ifstream file(absl::StrCat("/proc/", process, "/task/", process, "/children"));
  pid_t child = 0;
  file >> child;
  return child;
}

TEST(Contained, EndsWithWhoAsked) {
  const pid_t asks = ::fork();
  if (asks == 0) {
    (void)ReadApart({.path = "p"}, []() -> absl::StatusOr<Model> { RunForEver(); });
    ::_exit(0);
  }
  pid_t reads = 0;
  while (reads == 0) reads = ChildOf(asks);
  const int reader = static_cast<int>(::syscall(SYS_pidfd_open, reads, 0));
  ASSERT_GE(reader, 0);
  ASSERT_EQ(::kill(asks, SIGKILL), 0);
  ASSERT_EQ(::waitpid(asks, nullptr, 0), asks);
  pollfd ended = {.fd = reader, .events = POLLIN, .revents = 0};
  EXPECT_EQ(::poll(&ended, 1, 30'000), 1) << "it still runs";
  ::close(reader);
}

// Frames of one point each, at the frame's number, except where `spoil` does something else.
class Points final : public FrameSource {
 public:
  explicit Points(std::function<void(int64_t, Model&)> spoil) : spoil_(std::move(spoil)) {}
  int64_t count() const override { return 5; }
  absl::StatusOr<Model> Read(int64_t frame) override {
    Model model;
    model.path = "p";
    model.parts.push_back({.kind = Kind::kPoints,
                           .positions = {{static_cast<float>(frame), 0, 0}},
                           .colors = {{1, 2, 3}}});
    spoil_(frame, model);
    return model;
  }

 private:
  const std::function<void(int64_t, Model&)> spoil_;
};

absl::StatusOr<std::unique_ptr<FrameSource>> PointFrames(std::function<void(int64_t, Model&)> spoil,
                                                         Interrupt* interrupt = nullptr,
                                                         const ReaderLimits& limits = {}) {
  return OpenApart(
      {.path = "p"},
      [spoil = std::move(spoil)](SourceFile) -> absl::StatusOr<std::unique_ptr<FrameSource>> {
        return std::make_unique<Points>(spoil);
      },
      interrupt, limits);
}

TEST(ContainedFrames, AreReadInAnyOrderByAnotherProcess) {
  const pid_t self = ::getpid();
  const auto frames = PointFrames(
      [self](int64_t, Model& model) { model.note = ::getpid() == self ? "here" : "elsewhere"; });
  ASSERT_THAT(frames, IsOk());
  EXPECT_EQ((*frames)->count(), 5);
  for (const int64_t frame : {3, 0, 4, 4, 1}) {
    const auto model = (*frames)->Read(frame);
    ASSERT_THAT(model, IsOk());
    EXPECT_EQ(model->note, "elsewhere");
    EXPECT_EQ(model->parts[0].positions[0].x, static_cast<float>(frame));
  }
}

TEST(ContainedFrames, ErrorFromOpenIsReturned) {
  const auto frames = OpenApart({.path = "p"}, [](SourceFile) {
    return absl::StatusOr<std::unique_ptr<FrameSource>>(absl::InvalidArgumentError("p: no frames"));
  });
  EXPECT_EQ(frames.status(), absl::InvalidArgumentError("p: no frames"));
}

TEST(ContainedFrames, ACrashEndsOnlyTheReader) {
  const auto frames = PointFrames([](int64_t frame, Model&) {
    if (frame == 2) *static_cast<volatile int*>(nullptr) = 1;
  });
  ASSERT_THAT(frames, IsOk());
  EXPECT_THAT((*frames)->Read(1), IsOk());
  const auto crashed = (*frames)->Read(2);
  EXPECT_THAT(std::string(crashed.status().message()), HasSubstr("p: the library that reads it"));
  // The error is permanent.
  EXPECT_EQ((*frames)->Read(1).status(), crashed.status());
}

TEST(ContainedFrames, EachFrameIsChecked) {
  const auto frames = PointFrames([](int64_t frame, Model& model) {
    if (frame == 1) model.parts[0].positions[0].x = std::nanf("");
    if (frame == 2) model.parts[0].indices = {7};
  });
  ASSERT_THAT(frames, IsOk());
  EXPECT_FALSE((*frames)->Read(1).ok());
  EXPECT_FALSE((*frames)->Read(2).ok());
  EXPECT_THAT((*frames)->Read(3), IsOk());
}

TEST(ContainedFrames, ReaderCannotOpenFilesOutsideOfTheFolder) {
  TempFolder folder;
  const std::string inside = folder.Write("inside", "x");
  TempFolder other;
  const std::string outside = other.Write("outside", "x");
  if (!Sandbox::Get().CheckLandlock().ok()) GTEST_SKIP() << "this kernel has no Landlock";
  const auto frames =
      OpenApart({.path = inside}, [&](SourceFile) -> absl::StatusOr<std::unique_ptr<FrameSource>> {
        return std::make_unique<Points>([&](int64_t, Model& model) {
          model.note = absl::StrCat(Opens(inside), Opens(outside));
        });
      });
  ASSERT_THAT(frames, IsOk());
  EXPECT_EQ((*frames)->Read(0)->note, "10");
}

// A compromised reader can write anything to its socket.
void Send(const std::string& bytes) {
  (void)!::write(kAnswerDescriptor, bytes.data(), bytes.size());
}

TEST(ContainedFrames, HalfAnAnswerKeepsTheParentWaitingNoLongerThanItsLimits) {
  for (const ReaderLimits& limits :
       {ReaderLimits{.processor_s = 0.5}, ReaderLimits{.reading_s = 0.5}}) {
    const auto frames = PointFrames(
        [](int64_t frame, Model&) {
          if (frame != 1) return;
          Send("VXMO");
          RunForEver();
        },
        nullptr, limits);
    ASSERT_THAT(frames, IsOk());
    EXPECT_THAT((*frames)->Read(0), IsOk());
    const absl::Status late = (*frames)->Read(1).status();
    EXPECT_THAT(std::string(late.message()), HasSubstr("timed out after 0.5 s"));
    EXPECT_EQ((*frames)->Read(0).status(), late) << "it is not called again";
  }
}

// Sending a byte now and then does not restart the time limit.
TEST(ContainedFrames, AnAnswerInDropsHasTheSameLimit) {
  const auto frames = PointFrames(
      [](int64_t, Model&) {
        Send(std::string("VXMODEL\2\0\0\0\0", 12));
        for (;;) {
          Send(std::string(1, '\0'));
          ::usleep(1000);
        }
      },
      nullptr, {.reading_s = 0.5, .frame_bytes = 1 << 20});
  ASSERT_THAT(frames, IsOk());
  EXPECT_FALSE((*frames)->Read(0).ok());
}

TEST(ContainedFrames, AnswersThatNobodyAskedForDoNotBlockTheParent) {
  const auto frames = PointFrames([](int64_t frame, Model&) {
    if (frame != 0) return;
    // It sends endlessly, and no longer reads requests.
    for (;;) Send(std::string(4096, 'x'));
  });
  ASSERT_THAT(frames, IsOk());
  for (int i = 0; i < 1000; ++i) EXPECT_FALSE((*frames)->Read(0).ok());
}

TEST(Contained, AnswersThatNoReaderGivesAreRefused) {
  const std::string ok = std::string("VXMODEL\2\0\0\0\0", 12), none(8, '\0');
  const std::string many("\xff\xff\xff\x7f\0\0\0\0", 8);    // 2³¹ − 1
  const std::string head = ok + none + none + none + none;  // the texts and what is left out
  // What follows is up, the unit and three flags, which are 12 bytes.
  struct Case {
    std::string bytes, says;
  };
  for (const auto& [bytes, says] :
       {Case{"", "gave up"}, Case{"VXMODEL", "gave up"},
        Case{std::string(64, 'x'), "gave an answer that is none"},
        Case{std::string("VXMODEL\1\0\0\0\0", 12), "are of different releases"},
        Case{ok, "gave up halfway"}, Case{ok + many, "gave up halfway"},
        Case{head + "\7", "gave up halfway"},                                 // up
        Case{head + std::string(12, '\0') + many, "gave up halfway"},         // parts
        Case{head + std::string(12, '\0') + "\1" + none, "gave up halfway"},  // no whole number
        Case{head + std::string(12, '\0') + "\1" + std::string(7, '\0') + "\x09",
             "gave up halfway"}}) {  // the kind of a part
    const auto model = ReadApart({.path = "p"}, [&bytes]() -> absl::StatusOr<Model> {
      Send(bytes);
      ::_exit(0);
    });
    EXPECT_THAT(std::string(model.status().message()), HasSubstr(says)) << bytes.size();
  }
}

TEST(Contained, AnAnswerOfMoreThanTheLimitIsRefused) {
  const auto model = ReadApart(
      {.path = "p"},
      []() -> absl::StatusOr<Model> {
        Model large;
        large.parts.push_back({.kind = Kind::kPoints, .positions = std::vector<Point3>(1 << 20)});
        return large;
      },
      nullptr, {.model_bytes = 1 << 20});
  EXPECT_THAT(std::string(model.status().message()), HasSubstr("made more than 1048576 bytes"));
}

// Returns the memory of this process, in bytes.
int64_t ResidentBytes() {
  std::ifstream file("/proc/self/statm");
  int64_t all = 0, resident = 0;
  file >> all >> resident;
  return resident * ::sysconf(_SC_PAGESIZE);
}

TEST(Contained, MemoryOfAModelIsGivenBackWhileItIsWritten) {
  constexpr int64_t kModelBytes = int64_t{48} << 20;
  int ends[2] = {-1, -1};
  ASSERT_EQ(::socketpair(AF_UNIX, SOCK_STREAM, 0, ends), 0);
  Model model;
  model.parts.push_back(
      {.kind = Kind::kPoints,
       .positions = std::vector<Point3>(kModelBytes / sizeof(Point3), {1, 2, 3})});
  const int64_t before = ResidentBytes();
  int64_t freed = 0;
  std::thread takes([&] {
    std::vector<char> some(1 << 16);
    for (int64_t taken = 0; taken < kModelBytes / 4 * 3;) {
      const ssize_t got = ::read(ends[0], some.data(), some.size());
      ASSERT_GT(got, 0);
      taken += got;
    }
    freed = before - ResidentBytes();
    while (::read(ends[0], some.data(), some.size()) > 0) {
    }
  });
  EXPECT_TRUE(WriteModel(std::move(model), ends[1]));
  ::close(ends[1]);
  takes.join();
  ::close(ends[0]);
  EXPECT_GT(freed, kModelBytes / 2);
}

TEST(ContainedFrames, CountsHaveALimit) {
  class Many final : public FrameSource {
   public:
    int64_t count() const override { return int64_t{1} << 40; }
    absl::StatusOr<Model> Read(int64_t) override { return Model(); }
  };
  const auto many =
      OpenApart({.path = "p"}, [](SourceFile) -> absl::StatusOr<std::unique_ptr<FrameSource>> {
        return std::make_unique<Many>();
      });
  EXPECT_THAT(std::string(many.status().message()), HasSubstr("counts 1099511627776 frames"));
}

TEST(ContainedFrames, AnInterruptEndsAFrameThatTakesForEver) {
  Interrupt interrupt(Interrupt::Watch::kNothing);
  const auto frames = PointFrames(
      [](int64_t frame, Model&) {
        if (frame == 1) RunForEver();
      },
      &interrupt);
  ASSERT_THAT(frames, IsOk());
  EXPECT_THAT((*frames)->Read(0), IsOk());
  std::thread stop([&interrupt] { interrupt.Request(); });
  EXPECT_EQ((*frames)->Read(1).status().code(), absl::StatusCode::kCancelled);
  stop.join();
}

}  // namespace contained_test
}  // namespace voxeld::voxelctl
