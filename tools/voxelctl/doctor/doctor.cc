#include "tools/voxelctl/doctor/doctor.h"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <optional>
#include <system_error>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "common/text/printable.h"
#include "daemon/address/address.h"
#include "tools/voxelctl/text/proto_json.h"

namespace voxeld::voxelctl {
namespace {

namespace fs = std::filesystem;
using State = Finding::State;

constexpr char kRules[] = "70-voxeld.rules";
// Space for the volumes in flight: a large one and the next.
constexpr int kUsbfsMb = 64;

std::string ReadLine(const fs::path& path) {
  std::ifstream file(path);
  std::string line;
  std::getline(file, line);
  return std::string(absl::StripAsciiWhitespace(line));
}

std::vector<fs::path> EntriesOf(const fs::path& folder) {
  std::vector<fs::path> entries;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(folder, error)) entries.push_back(entry.path());
  std::sort(entries.begin(), entries.end());
  return entries;
}

bool HasRules(const Machine& machine) {
  return std::any_of(machine.rule_folders.begin(), machine.rule_folders.end(),
                     [](const std::string& folder) {
                       std::error_code error;
                       return fs::exists(fs::path(folder) / kRules, error);
                     });
}

Finding OfRules(const Machine& machine) {
  if (HasRules(machine)) return {"udev", State::kGood, absl::StrCat(kRules, " is installed"), ""};
  return {"udev", State::kNote,
          absl::StrCat(kRules, " is not installed: devices belong to root alone"),
          absl::StrCat("sudo cp packaging/", kRules,
                       " /etc/udev/rules.d/ && sudo udevadm control --reload && sudo udevadm "
                       "trigger --subsystem-match=usb")};
}

// Returns which device voxeld would drive; empty if it is none of these.
std::string KindOf(const fs::path& device) {
  if (ReadLine(device / "idVendor") == "1d50" && ReadLine(device / "idProduct") == "607a") {
    return "Fadecandy";
  }
  for (const fs::path& part : EntriesOf(device)) {
    if (ReadLine(part / "bInterfaceClass") == "ff" &&
        ReadLine(part / "bInterfaceSubClass") == "56" &&
        ReadLine(part / "bInterfaceProtocol") == "01") {
      return "voxlink device";
    }
  }
  return "";
}

std::vector<Finding> OfDevices(const Machine& machine) {
  std::vector<Finding> findings;
  for (const fs::path& device : EntriesOf(fs::path(machine.sys) / "bus/usb/devices")) {
    const std::string kind = KindOf(device);
    int bus = 0, number = 0;
    if (kind.empty() || !absl::SimpleAtoi(ReadLine(device / "busnum"), &bus) ||
        !absl::SimpleAtoi(ReadLine(device / "devnum"), &number)) {
      continue;
    }
    const std::string node = absl::StrFormat("%s/bus/usb/%03d/%03d", machine.dev, bus, number);
    const std::string name = absl::StrCat(kind, " ", ReadLine(device / "serial"), " at ", node);
    if (machine.writable(node)) {
      findings.push_back({"usb", State::kGood, absl::StrCat(name, " can be opened"), ""});
      continue;
    }
    // The udev rules take effect when a device is attached, or when they are triggered.
    findings.push_back(
        {"usb", State::kBad, absl::StrCat(name, " cannot be opened: it is not yours to write"),
         HasRules(machine)
             ? absl::StrCat("sudo udevadm trigger --action=add ", device.string(),
                            " && sudo usermod -aG voxeld \"$USER\"   # then log in again")
             : OfRules(machine).fix});
  }
  if (findings.empty()) {
    findings.push_back({"usb", State::kGood, "no Fadecandy and no voxlink device is attached", ""});
  }
  return findings;
}

Finding OfUsbfs(const Machine& machine) {
  const std::string parameter = "module/usbcore/parameters/usbfs_memory_mb";
  const fs::path path = fs::path(machine.sys) / parameter;
  int mb = 0;
  if (!absl::SimpleAtoi(ReadLine(path), &mb)) {
    return {"usbfs", State::kGood,
            "this kernel has no USB; simulated and network displays need none", ""};
  }
  if (mb == 0) return {"usbfs", State::kGood, "memory for USB transfers is not limited", ""};
  const std::string text = absl::StrCat(mb, " MB for USB transfers of all programs together");
  if (mb >= kUsbfsMb) return {"usbfs", State::kGood, text, ""};
  return {"usbfs", State::kNote,
          absl::StrCat(text, "; a large volume and the next want ", kUsbfsMb),
          absl::StrCat("echo ", kUsbfsMb, " | sudo tee ", path.string())};
}

bool HasNvidiaCard(const Machine& machine) {
  const auto cards = EntriesOf(fs::path(machine.sys) / "bus/pci/devices");
  return std::any_of(cards.begin(), cards.end(), [](const fs::path& card) {
    // The card is NVIDIA's, and a display controller.
    return ReadLine(card / "vendor") == "0x10de" &&
           absl::StartsWith(ReadLine(card / "class"), "0x03");
  });
}

Finding OfCuda(const Machine& machine) {
  const CudaState cuda = machine.cuda();
  if (!cuda.installed) {
    if (!HasNvidiaCard(machine)) {
      return {"cuda", State::kGood, "no NVIDIA GPU: the CPU draws", ""};
    }
    return {"cuda", State::kBad, "there is an NVIDIA GPU, but libcuda.so.1 is not there",
            "sudo apt install nvidia-driver libcuda1"};
  }
  if (cuda.error != 0) {
    return {"cuda", State::kBad,
            absl::StrCat("libcuda.so.1 answers with error ", cuda.error,
                         ": the kernel's driver is not loaded, or not of its version"),
            "sudo modprobe nvidia && nvidia-smi   # if that differs in versions, reboot"};
  }
  if (cuda.devices.empty()) return {"cuda", State::kGood, "no GPU: the CPU draws", ""};
  return {"cuda", State::kGood, absl::StrJoin(cuda.devices, ", "), ""};
}

// `own` is the state of the port while voxeld runs.
Finding OfPort(const Machine& machine, uint16_t port, PortState own, const std::string& elsewhere) {
  const auto use_of = [](PortState state) {
    return state == PortState::kHttp ? "health and metrics" : "clients";
  };
  const std::string name = absl::StrCat("127.0.0.1:", port, " (", use_of(own), ")");
  const PortState state = machine.port(port);
  if (state == PortState::kFree) {
    return {"port", State::kGood, absl::StrCat(name, " is free"), ""};
  }
  if (state == own) return {"port", State::kGood, absl::StrCat("voxeld answers at ", name), ""};
  return {"port", State::kBad,
          absl::StrCat(name, " is taken by ",
                       state == PortState::kOther
                           ? "another program"
                           : absl::StrCat("a voxeld's port for ", use_of(state))),
          absl::StrCat(elsewhere, "   # ss -ltnp 'sport = :", port, "' says whose it is")};
}

const char* WordOf(State state) {
  switch (state) {
    case State::kGood:
      return "good";
    case State::kNote:
      return "note";
    case State::kBad:
      return "bad";
  }
  return "";
}

}  // namespace

std::vector<Finding> Examine(const Machine& machine) {
  std::vector<Finding> findings = OfDevices(machine);
  findings.push_back(OfRules(machine));
  findings.push_back(OfUsbfs(machine));
  findings.push_back(OfCuda(machine));
  const uint16_t port = machine.clients_port;
  findings.push_back(OfPort(machine, port, PortState::kClients,
                            absl::StrCat("voxeld --listen 127.0.0.1:", port % UINT16_MAX + 1)));
  findings.push_back(OfPort(machine, 8088, PortState::kHttp, "voxeld --http 127.0.0.1:8089"));
  return findings;
}

absl::Status Doctor(Machine machine, const std::string& server, Console& console) {
  if (!server.empty()) {
    const absl::StatusOr<daemon::Address> address = daemon::ParseAddress(server);
    if (!address.ok()) return address.status();
    const bool here = address->host == "127.0.0.1" || address->host == "localhost";
    if (address->tls || !here || address->port == 0) {
      return absl::InvalidArgumentError(
          absl::StrCat("doctor looks at plain ports of 127.0.0.1, and --server ", server,
                       " is none; give 127.0.0.1:PORT, or leave it out"));
    }
    machine.clients_port = address->port;
  }
  const std::vector<Finding> findings = Examine(machine);
  const auto bad = std::count_if(findings.begin(), findings.end(),
                                 [](const Finding& f) { return f.state == State::kBad; });
  if (console.json()) {
    nlohmann::ordered_json json = nlohmann::ordered_json::array();
    for (const Finding& f : findings) {
      json.push_back(
          {{"what", f.what}, {"state", WordOf(f.state)}, {"text", f.text}, {"fix", f.fix}});
    }
    console.Data(JsonText(json, false));
  } else {
    for (const Finding& f : findings) {
      console.Data(
          absl::StrFormat("%s  %-5s  %s\n", WordOf(f.state), f.what, EscapeForTerminal(f.text)));
      if (!f.fix.empty()) console.Data(absl::StrCat("             ", f.fix, "\n"));
    }
  }
  if (bad == 0) return absl::OkStatus();
  return absl::FailedPreconditionError(
      absl::StrCat(bad, bad == 1 ? " thing is" : " things are", " to be mended"));
}

}  // namespace voxeld::voxelctl
