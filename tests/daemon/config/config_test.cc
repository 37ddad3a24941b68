#include "daemon/config/config.h"

#include <gmock/gmock.h>
#include <unistd.h>
#include <algorithm>

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <set>
#include <sstream>

#include "absl/strings/str_cat.h"
#include "common/text/suggest.h"

namespace voxeld::daemon {
namespace config_test {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::Pair;
using ::testing::SizeIs;
using ::testing::UnorderedElementsAre;

Environment Variables(std::map<std::string, std::string> variables) {
  return [variables = std::move(variables)](const char* name) -> std::optional<std::string> {
    const auto it = variables.find(name);
    if (it == variables.end()) return {};
    return it->second;
  };
}

TEST(ConfigText, EveryFieldStandsInTheManual) {
  std::ifstream file(VOXELD_SOURCE_DIR "/docs/configuration.md");
  const std::string manual{std::istreambuf_iterator<char>(file), {}};
  std::istringstream printed(ToToml(Config{}));
  int keys = 0;
  for (std::string line; std::getline(printed, line);) {
    const size_t equals = line.find(" = ");
    if (equals == std::string::npos) continue;
    ++keys;
    EXPECT_THAT(manual, HasSubstr("`" + line.substr(0, equals) + "`"));
  }
  EXPECT_GE(keys, 40);
}

TEST(ConfigText, EverythingCanBeSet) {
  Config config;
  const absl::Status status = ReadConfigText(R"(
[server]
listen = ["[::1]:7", "unix:/run/x.sock"]
http = "off"
max_queued_answers = 100
max_http_connections = 3
[engine]
kind = "cpu"
threads = 5
staging_limit_bytes = 2_097_152
device = 3
index_bytes = 1_048_576
in_worker = true
worker = "/opt/engine"
nccl = "/opt/libnccl.so.2"
worker_deadline_ns = 500_000_000
[log]
level = "warn"
format = "json"
[limits]
max_message_bytes = 0x10000
max_coordinate_voxels = 1024
max_id_bytes = 7
[[display]]
name = "rotor"
driver = "simulated"
geometry = "rotor"
slices = 360
eccentricity = [13.5, 0.375]
mirror = true
[[display]]
name = "other"
driver = "simulated"
)",
                                             "test.toml", &config);
  ASSERT_TRUE(status.ok()) << status;
  EXPECT_EQ(config.file, "test.toml");
  ASSERT_THAT(config.server.listen, SizeIs(2));
  EXPECT_EQ(config.server.listen[0].host, "::1");
  EXPECT_EQ(config.server.listen[1].path, "/run/x.sock");
  EXPECT_FALSE(config.server.http.has_value());
  EXPECT_TRUE(config.server.http_asked);
  EXPECT_EQ(config.server.max_queued_answers, 100u);
  EXPECT_EQ(config.server.max_http_connections, 3u);
  EXPECT_EQ(config.engine.kind, gpu::EngineKind::kCpu);
  EXPECT_EQ(config.engine.threads, 5u);
  EXPECT_EQ(config.engine.staging_limit_bytes, 2097152u);
  EXPECT_EQ(config.engine.device, 3u);
  EXPECT_EQ(config.engine.index_bytes, 1048576u);
  EXPECT_TRUE(config.engine.in_worker);
  EXPECT_EQ(config.engine.worker, "/opt/engine");
  EXPECT_EQ(config.engine.nccl, "/opt/libnccl.so.2");
  EXPECT_EQ(config.engine.worker_deadline_ns, sync::kSecond / 2);
  EXPECT_EQ(config.log.level, "warn");
  EXPECT_EQ(config.log.format, "json");
  EXPECT_EQ(config.limits.max_message_bytes, 65536u);
  EXPECT_EQ(config.limits.max_coordinate_voxels, 1024);
  EXPECT_EQ(config.limits.max_id_bytes, 7u);
  EXPECT_EQ(config.limits.max_sessions, Limits().max_sessions);
  ASSERT_THAT(config.displays, SizeIs(2));
  EXPECT_EQ(config.displays[0].name, "rotor");
  EXPECT_EQ(config.displays[0].driver, "simulated");
  EXPECT_THAT(config.displays[0].options,
              UnorderedElementsAre(Pair("geometry", "rotor"), Pair("slices", "360"),
                                   Pair("eccentricity", "13.5;0.375"), Pair("mirror", "true")));
  EXPECT_EQ(config.displays[0].source, "test.toml:24:1");
}

TEST(ConfigText, NoDisplaysAtAllCanBeAskedForAndReadsBack) {
  Config config;
  config.displays.push_back({"sim", "simulated", {}, "the default"});
  const char* text = "display = []\n[server]\nlisten = [\"unix:/x\"]\n[limits]\nmax_sessions = 3\n";
  ASSERT_TRUE(ReadConfigText(text, "t", &config).ok());
  EXPECT_THAT(config.displays, SizeIs(0));
  Config again;
  again.displays.push_back({"sim", "simulated", {}, "the default"});
  const absl::Status status = ReadConfigText(ToToml(config), "again", &again);
  ASSERT_TRUE(status.ok()) << status;
  EXPECT_THAT(again.displays, SizeIs(0));
  EXPECT_EQ(again.limits.max_sessions, 3u);
}

struct Case {
  const char* name;
  const char* text;
  const char* where;
  const char* what;
};

const Case kCases[] = {
    {"syntax", "[server\n", "t:1:8: ", ""},
    {"section", "\n[sever]\n", "t:2:2: ", "unknown key sever; did you mean server?"},
    {"key", "[limits]\nmax_sesions = 3\n",
     "t:2:1: ", "unknown key limits.max_sesions; did you mean max_sessions?"},
    {"key_unlike", "[log]\nzebra = 3\n", "t:2:1: ", "known are level, format"},
    {"no_table", "log = 3\n", "t:1:7: ", "log is 3; write [log]"},
    {"integer_type", "[limits]\nmax_sessions = \"3\"\n",
     "t:2:16: ", "give an integer from 1 to 4294967295"},
    {"integer_low", "[limits]\n  max_sessions = 0\n", "t:2:18: ", "limits.max_sessions is 0"},
    {"integer_high", "[limits]\nmax_instance_depth = 9\n", "t:2:22: ", "from 1 to 8"},
    {"real_type", "[limits]\nmax_coordinate_voxels = true\n", "t:2:25: ", "is true; give a number"},
    {"real_nan", "[limits]\nmax_coordinate_voxels = nan\n", "t:2:25: ", "is nan; give a number"},
    {"choice", "[log]\nlevel = \"wran\"\n", "t:2:9: ", "log.level is \"wran\"; did you mean warn?"},
    {"text_type", "[log]\nformat = 1\n", "t:2:10: ", "log.format is 1; give text in quotes"},
    {"engine", "[engine]\nkind = \"gpu\"\n", "t:2:8: ", "engine.kind is \"gpu\""},
    {"listen_type", "[server]\nlisten = \"127.0.0.1:1\"\n", "t:2:10: ", "give an array"},
    {"listen_empty", "[server]\nlisten = []\n", "t:2:10: ", "give an array"},
    {"listen_item", "[server]\nlisten = [\"127.0.0.1:1\", 3]\n", "t:2:26: ", "addresses as text"},
    {"listen_address", "[server]\nlisten = [\"nowhere\"]\n", "t:2:11: ", "has no port"},
    {"http", "[server]\nhttp = \"127.0.0.1\"\n", "t:2:8: ", "has no port"},
    {"worker_relative", "[engine]\nworker = \"unix:here\"\n",
     "t:2:10: ", "engine.worker is \"unix:here\", which is no absolute path; give a program"},
    {"worker_type", "[engine]\nworker = 1\n", "t:2:10: ", "give text in quotes"},
    {"local_type", "[server]\nlocal_socket = false\n", "t:2:16: ", "give text in quotes"},
    {"local_tcp", "[server]\nlocal_socket = \"127.0.0.1:1\"\n",
     "t:2:16: ", "server.local_socket is refused: \"127.0.0.1:1\" is no path of a unix socket"},
    {"local_relative", "[server]\nlocal_socket = \"unix:here\"\n", "t:2:16: ", "absolute path"},
    {"local_word", "[server]\nlocal_socket = \"off\"\n", "t:2:16: ", "\"\" for none"},
    {"display_type", "display = 3\n", "t:1:11: ", "write [[display]]"},
    {"display_table", "[display]\nname = \"a\"\n", "t:1:1: ", "write [[display]]"},
    {"display_nameless", "\n[[display]]\ndriver = \"d\"\n", "t:2:1: ", "a display without name"},
    {"display_driverless", "[[display]]\nname = \"a\"\n", "t:1:1: ", "a display without driver"},
    {"display_name", "[[display]]\nname = \"a b\"\ndriver = \"d\"\n", "t:2:8: ", "\"a b\" is not"},
    {"display_twice",
     "[[display]]\nname=\"a\"\ndriver=\"d\"\n[[display]]\nname=\"a\"\ndriver=\"d\"\n",
     "t:4:1: ", "two displays named \"a\""},
    {"display_option", "[[display]]\nname=\"a\"\ndriver=\"d\"\nwhen = 2001-01-01\n",
     "t:4:8: ", "display.when is no text"},
};

class WrongConfig : public ::testing::TestWithParam<Case> {};

TEST_P(WrongConfig, SaysWhereAndWhat) {
  Config config;
  const absl::Status status = ReadConfigText(GetParam().text, "t", &config);
  ASSERT_TRUE(absl::IsInvalidArgument(status)) << status;
  EXPECT_THAT(std::string(status.message()), HasSubstr(GetParam().where));
  EXPECT_THAT(std::string(status.message()), HasSubstr(GetParam().what));
}

INSTANTIATE_TEST_SUITE_P(File, WrongConfig, ::testing::ValuesIn(kCases),
                         [](const auto& info) { return std::string(info.param.name); });

TEST(ConfigText, WhereTheLocalSocketIs) {
  const auto where = [](std::vector<std::string> listen, const std::string& text) -> std::string {
    Config config;
    const absl::Status status = ReadConfigText(text, "t", &config);
    EXPECT_TRUE(status.ok()) << status;
    for (const std::string& address : listen) {
      config.server.listen.push_back(*ParseAddress(address));
    }
    const auto local = LocalSocketAddress(config.server);
    EXPECT_TRUE(local.ok()) << local.status();
    return local.ok() && local->has_value() ? (*local)->ToString() : "";
  };
  const std::string tcp = "127.0.0.1:1";
  EXPECT_EQ(where({tcp, "unix:/run/a.sock", "unix:/run/b.sock"}, ""), "unix:/run/a.sock.local");
  EXPECT_EQ(where({tcp}, ""), "");
  EXPECT_EQ(where({"unix:/" + std::string(102, 'x')}, ""), "") << "too long with its suffix";
  EXPECT_EQ(where({"unix:/" + std::string(102, 'x'), "unix:/b"}, ""), "unix:/b.local");
  EXPECT_EQ(where({"unix:/a"}, "[server]\nlocal_socket = \"\"\n"), "");
  EXPECT_EQ(where({"unix:/a"}, "[server]\nlocal_socket = \"auto\"\n"), "unix:/a.local");
  EXPECT_EQ(where({tcp}, "[server]\nlocal_socket = \"/run/c\"\n"), "unix:/run/c");
  EXPECT_EQ(where({tcp}, "[server]\nlocal_socket = \"unix:/run/c\"\n"), "unix:/run/c");
  ServerConfig same;
  same.listen = {*ParseAddress("unix:/a")};
  same.local_socket = "/a";
  EXPECT_TRUE(absl::IsInvalidArgument(LocalSocketAddress(same).status()));
}

TEST(ConfigText, TellsEveryFault) {
  Config config;
  const absl::Status status =
      ReadConfigText("[log]\nlevel = 1\nformat = 2\n[limits]\nnope = 1\n", "t", &config);
  const std::string message(status.message());
  EXPECT_THAT(message, HasSubstr("t:2:9: "));
  EXPECT_THAT(message, HasSubstr("t:3:10: "));
  EXPECT_THAT(message, HasSubstr("t:5:1: "));
}

TEST(ConfigText, PrintsWhatReadsBackTheSame) {
  Config config;
  ASSERT_TRUE(ReadConfigText("[limits]\nmax_coordinate_voxels = 0.5e3\n[[display]]\nname = \"a\"\n"
                             "driver = \"d\"\n\"odd key\" = \"say \\\"x\\\"\"\n",
                             "t", &config)
                  .ok());
  config.server.listen = {*ParseAddress("127.0.0.1:1"), *ParseAddress("unix:/a b")};
  const std::string text = ToToml(config);
  Config again;
  const absl::Status status = ReadConfigText(text, "t", &again);
  ASSERT_TRUE(status.ok()) << status << "\n" << text;
  EXPECT_EQ(ToToml(again), text);
  EXPECT_EQ(again.limits.max_coordinate_voxels, 500);
  EXPECT_EQ(again.server.listen, config.server.listen);
  EXPECT_EQ(again.displays[0].options, config.displays[0].options);
}

TEST(FindConfigFile, PrefersTheUsersOwn) {
  std::set<std::string> files;
  const auto exists = [&files](const std::string& path) { return files.contains(path); };
  const Environment both = Variables({{"XDG_CONFIG_HOME", "/xdg"}, {"HOME", "/home/me"}});
  EXPECT_EQ(FindConfigFile(both, exists), "");
  files = {"/etc/voxeld/voxeld.toml"};
  EXPECT_EQ(FindConfigFile(both, exists), "/etc/voxeld/voxeld.toml");
  EXPECT_EQ(FindConfigFile(Variables({}), exists), "/etc/voxeld/voxeld.toml");
  files.insert("/home/me/.config/voxeld/voxeld.toml");
  EXPECT_EQ(FindConfigFile(both, exists), "/etc/voxeld/voxeld.toml");
  EXPECT_EQ(FindConfigFile(Variables({{"HOME", "/home/me"}}), exists),
            "/home/me/.config/voxeld/voxeld.toml");
  EXPECT_EQ(
      FindConfigFile(Variables({{"XDG_CONFIG_HOME", "relative"}, {"HOME", "/home/me"}}), exists),
      "/home/me/.config/voxeld/voxeld.toml");
  files.insert("/xdg/voxeld/voxeld.toml");
  EXPECT_EQ(FindConfigFile(both, exists), "/xdg/voxeld/voxeld.toml");
}

// Each test has a file of its own in the test's folder.
class LoadedConfig : public ::testing::Test {
 protected:
  std::string Write(const std::string& text) {
    const std::string path = absl::StrCat(::testing::TempDir(), "/voxeld-config-", getpid());
    std::ofstream(path) << text;
    path_ = path;
    return path;
  }
  ~LoadedConfig() override {
    if (!path_.empty()) std::remove(path_.c_str());
  }
  std::string path_;
};

TEST_F(LoadedConfig, DefaultsThenFileThenCommandLine) {
  const Environment environment = Variables({{"XDG_RUNTIME_DIR", "/run/me"}});
  absl::StatusOr<Config> config = LoadConfig(Write(""), environment);
  ASSERT_TRUE(config.ok()) << config.status();
  ASSERT_THAT(config->server.listen, SizeIs(2));
  EXPECT_EQ(config->server.listen[0].ToString(), "127.0.0.1:50551");
  EXPECT_EQ(config->server.listen[1].ToString(), "unix:/run/me/voxeld.sock");
  EXPECT_EQ(config->server.http->ToString(), "127.0.0.1:8088");
  EXPECT_FALSE(config->server.http_asked);
  ASSERT_THAT(config->displays, SizeIs(1));
  EXPECT_EQ(config->displays[0].name, "sim");
  EXPECT_EQ(config->displays[0].driver, "simulated");

  config = LoadConfig(Write("[server]\nlisten = [\"h:1\"]\n[[display]]\nname=\"a\"\ndriver=\"d\"\n"
                            "[log]\nlevel = \"error\"\nformat = \"json\"\n"),
                      environment);
  ASSERT_TRUE(config.ok()) << config.status();
  EXPECT_THAT(config->server.listen, SizeIs(1));
  EXPECT_EQ(config->displays[0].name, "a");

  CommandLine line;
  line.listen = {"i:2", "i:3"};
  line.displays = {"b=e,k=v"};
  line.http = "i:4";
  line.engine = "cpu";
  line.log_level = "debug";
  ASSERT_TRUE(ApplyCommandLine(line, &*config).ok());
  ASSERT_THAT(config->server.listen, SizeIs(2));
  EXPECT_EQ(config->server.listen[0].ToString(), "i:2");
  EXPECT_EQ(config->server.http->ToString(), "i:4");
  EXPECT_TRUE(config->server.http_asked);
  ASSERT_THAT(config->displays, SizeIs(1));
  EXPECT_EQ(config->displays[0].name, "b");
  EXPECT_EQ(config->engine.kind, gpu::EngineKind::kCpu);
  EXPECT_EQ(config->log.level, "debug");
  EXPECT_EQ(config->log.format, "json");
}

TEST_F(LoadedConfig, ANamedFileMustBeThere) {
  const auto config = LoadConfig("/nowhere/at/all.toml", Variables({}));
  EXPECT_TRUE(absl::IsNotFound(config.status())) << config.status();
  EXPECT_THAT(std::string(config.status().message()), HasSubstr("/nowhere/at/all.toml"));
}

TEST(ApplyCommandLine, UsageErrorsNameTheOption) {
  const auto refusal = [](const CommandLine& line) {
    Config config;
    return std::string(ApplyCommandLine(line, &config).message());
  };
  CommandLine line;
  line.listen = {"nowhere"};
  EXPECT_THAT(refusal(line), HasSubstr("--listen: "));
  line = {};
  line.http = "nowhere";
  EXPECT_THAT(refusal(line), HasSubstr("--http: "));
  line = {};
  line.displays = {"a=b", "a=c"};
  EXPECT_THAT(refusal(line), HasSubstr("--display: there are two displays named \"a\""));
  line = {};
  line.engine = "cpv";
  EXPECT_THAT(refusal(line), HasSubstr("--engine is \"cpv\"; did you mean cpu?"));
  for (const char* graphics : {"gpu", "GPU"}) {
    line.engine = graphics;
    EXPECT_THAT(refusal(line), HasSubstr("\"; did you mean cuda?")) << "not cpu";
  }
  line = {};
  line.log_level = "loud";
  EXPECT_THAT(refusal(line), HasSubstr("--log-level is \"loud\"; known are trace"));
  line = {};
  line.log_format = "jsn";
  EXPECT_THAT(refusal(line), HasSubstr("--log-format is \"jsn\"; did you mean json?"));
}

absl::StatusOr<CommandLine> Parse(std::vector<const char*> arguments) {
  arguments.insert(arguments.begin(), "voxeld");
  return ParseCommandLine(static_cast<int>(arguments.size()), arguments.data(), "1.2.3");
}

// As a shell's <(…) passes it.
TEST(ConfigFile, MayBeAPipeWhichIsReadOnce) {
  int ends[2];
  ASSERT_EQ(pipe(ends), 0);
  const std::string text = "[log]\nlevel = \"error\"\n";
  ASSERT_EQ(write(ends[1], text.data(), text.size()), static_cast<ssize_t>(text.size()));
  close(ends[1]);
  const std::string path = absl::StrCat("/dev/fd/", ends[0]);
  Config config;
  const absl::Status first = ReadConfigFile(path, &config);
  EXPECT_TRUE(first.ok()) << first;
  EXPECT_THAT(ToToml(config), HasSubstr("level = 'error'"));
  const absl::Status second = ReadConfigFile(path, &config);
  EXPECT_THAT(std::string(second.message()), HasSubstr("is a pipe with nothing in it"));
  close(ends[0]);
}

TEST(ConfigFile, OfNoSensibleSizeOrKindIsRefused) {
  Config config;
  EXPECT_THAT(std::string(ReadConfigFile("/dev/zero", &config).message()),
              HasSubstr("/dev/zero has more than the 16777216 bytes of a configuration"));
  EXPECT_THAT(std::string(ReadConfigFile("/", &config).message()), HasSubstr("Is a directory"));
  EXPECT_EQ(ReadConfigFile("/nowhere.toml", &config).code(), absl::StatusCode::kNotFound);
}

TEST(CommandLine, HasEveryOption) {
  const auto line = Parse({"--config", "f", "--listen", "a:1", "--listen=unix:/b", "--http", "off",
                           "--display", "x=y,z=1;2", "--display", "u=v", "--engine", "cuda",
                           "--log-level", "debug", "--log-format", "json", "--check-config"});
  ASSERT_TRUE(line.ok()) << line.status();
  EXPECT_EQ(line->config, "f");
  EXPECT_THAT(line->listen, ElementsAre("a:1", "unix:/b"));
  EXPECT_EQ(line->http, "off");
  EXPECT_THAT(line->displays, ElementsAre("x=y,z=1;2", "u=v"));
  EXPECT_EQ(line->engine, "cuda");
  EXPECT_EQ(line->log_level, "debug");
  EXPECT_EQ(line->log_format, "json");
  EXPECT_TRUE(line->check_config);
  EXPECT_EQ(line->print_and_exit, "");
}

TEST(CommandLine, NothingIsNothing) {
  const auto line = Parse({});
  ASSERT_TRUE(line.ok()) << line.status();
  EXPECT_FALSE(line->config || line->http || line->engine || line->log_level || line->log_format ||
               line->check_config);
  EXPECT_TRUE(line->listen.empty() && line->displays.empty());
}

TEST(CommandLine, HelpAndVersion) {
  EXPECT_EQ(Parse({"--version"})->print_and_exit, "voxeld 1.2.3\n");
  const std::string help = Parse({"--help"})->print_and_exit;
  for (const char* option : {"--config", "--listen", "--http", "--display", "--engine",
                             "--log-level", "--log-format", "--check-config", "--version"}) {
    EXPECT_THAT(help, HasSubstr(option));
  }
}

TEST(CommandLine, UsageErrorsSuggest) {
  EXPECT_THAT(std::string(Parse({"--lisen", "a:1"}).status().message()),
              HasSubstr("--lisen is no option here; did you mean --listen?"));
  EXPECT_THAT(std::string(Parse({"--dispaly=a"}).status().message()),
              HasSubstr("did you mean --display?"));
  EXPECT_THAT(std::string(Parse({"serve"}).status().message()),
              HasSubstr("\"serve\" is not expected"));
  EXPECT_THAT(std::string(Parse({"--listen"}).status().message()), HasSubstr("--listen"));
  EXPECT_THAT(std::string(Parse({"--http", "a", "--http", "b"}).status().message()),
              HasSubstr("--http"));
}

TEST(Suggest, WhatIsLikeAndNothingElse) {
  const std::vector<std::string> known = {"listen", "http", "display"};
  EXPECT_EQ(Nearest("lisetn", known), "listen");
  EXPECT_EQ(Nearest("htp", known), "http");
  EXPECT_EQ(Nearest("displays", known), "display");
  EXPECT_EQ(Nearest("zebra", known), "");
  // If only half of the letters match, no suggestion is made.
  EXPECT_EQ(Nearest("cube", {"cone", "box"}), "");
  EXPECT_EQ(Nearest("remove", {"demo", "clear"}), "");
  EXPECT_EQ(Nearest("", known), "");
  EXPECT_EQ(Nearest(std::string(100'000, 'x'), known), "");
  EXPECT_THAT(Suggestion("zebra", known), Not(HasSubstr("did you mean")));
}

TEST(Config, MessagesAreLinesOfPrintableText) {
  Config config;
  const absl::Status status = ReadConfigText(
      "\"un\\nknown\" = 1\n[engine]\nkind = \"\\u001b[2J\"\n[[display]]\nname = \"a\\nb\"\ndriver "
      "= \"simulated\"\n",
      "t", &config);
  const std::string message(status.message());
  EXPECT_EQ(std::count(message.begin(), message.end(), '\n'), 2) << message;
  EXPECT_EQ(std::count(message.begin(), message.end(), '\x1b'), 0) << message;
  EXPECT_NE(message.find("unknown key un\\x0aknown"), std::string::npos) << message;
}

TEST(Config, WhatTheParserQuotesIsPrintable) {
  Config config;
  const std::string message(ReadConfigText("a = t\x1c", "t", &config).message());
  EXPECT_EQ(message.rfind("t:1:", 0), 0u) << message;
  for (const char c : message) EXPECT_FALSE(c >= 0 && c < 32) << message;
}

}  // namespace config_test
}  // namespace voxeld::daemon
