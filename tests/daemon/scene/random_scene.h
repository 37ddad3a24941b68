// Random commits over few names, so that their operations often affect each other.
#pragma once

#include <random>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "tests/daemon/scene/store_fixture.h"

namespace voxeld::daemon::testing {

// Returns up to `most` operations; some will be refused.
inline std::vector<Operation> RandomOperations(std::mt19937& random, uint32_t most) {
  const auto name = [&](const char* prefix, uint32_t count) {
    return absl::StrCat(prefix, random() % count);
  };
  const auto transform = [&] {
    gpu::Affine map = Shift(random() % 7, random() % 7, random() % 7);
    map.m[1] = static_cast<double>(random() % 3) / 4;
    map.m[4] = static_cast<double>(random() % 3) / 8;
    return map;
  };
  const auto content = [&]() -> Content {
    if (random() % 3 == 0) return InstanceRef{name("o", 5)};
    return Dots(static_cast<float>(random() % 5), random() & 0xFFFFFF, 1 + random() % 3);
  };
  std::vector<Operation> all;
  for (uint32_t n = 1 + random() % most; n > 0; --n) {
    const std::string layer = name("l", 4), id = name("e", 12);
    switch (random() % 13) {
      case 0:
      case 1:
      case 2:
      case 3: {
        EntityData data = Entity1(content(), transform());
        data.priority = random() % 3;
        data.erase = random() % 5 == 0;
        data.lifetime_ns = random() % 4 == 0 ? 1 + random() % 20 : 0;
        all.push_back(Put(layer, id, std::move(data)));
        break;
      }
      case 4:
        all.push_back(Move(layer, id, transform()));
        break;
      case 5:
        all.push_back(DeleteId(layer, id, random() % 2 == 0 ? 0 : random() % 200));
        break;
      case 6:
        all.push_back(random() % 2 == 0 ? DeletePrefix(layer, "e1") : DeleteAllOf(layer));
        break;
      case 7:
        all.push_back(SetLayer(layer, random() % 2 == 0, transform()));
        if (random() % 2 == 0) {
          const gpu::ClipPlane plane{1, 0, 0, -static_cast<double>(random() % 3)};
          all.push_back(SetClip(layer, std::vector(random() % 3, plane)));
        } else if (random() % 2 == 0) {
          std::optional<gpu::Region> region;
          if (random() % 3 != 0) region = {{0, 0, 0}, {1, 1, 1.0 + random() % 3}};
          all.push_back(SetRegion(layer, region));
        } else {
          all.push_back(SetMask(layer, random() % 4 == 0 ? "" : name("l", 4)));
        }
        break;
      case 8:
        all.push_back(random() % 2 == 0 ? Begin(layer) : End(layer));
        break;
      case 9:
      case 10: {
        std::vector<ObjectPart> parts;
        for (uint32_t p = random() % 4; p > 0; --p) parts.push_back({content(), transform()});
        all.push_back(Define(name("o", 5), std::move(parts)));
        break;
      }
      case 11:
        all.push_back(Undefine(name("o", 5), random() % 2 == 0));
        break;
      case 12:
        if (random() % 6 == 0) all.push_back(DeleteAllMine());
        break;
    }
  }
  return all;
}

}  // namespace voxeld::daemon::testing
