// Compares PersistentMap with std::map.
#include "daemon/scene/persistent_map.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <optional>
#include <random>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"

namespace voxeld::daemon {
namespace {

using Map = PersistentMap<std::string, int>;
using Model = std::map<std::string, int>;

Model ToModel(const Map& map) {
  Model model;
  std::string last;
  map.ForEach([&](const std::string& key, int value) {
    EXPECT_TRUE(model.empty() || last < key);
    last = key;
    model[key] = value;
  });
  return model;
}

struct Change {
  std::string key;
  std::optional<int> before, after;
  bool operator==(const Change&) const = default;
};

std::vector<Change> Diff(const Map& a, const Map& b) {
  std::vector<Change> changes;
  Map::Diff(a, b, [&](const std::string& key, const int* before, const int* after) {
    changes.push_back({key, before ? std::optional(*before) : std::nullopt,
                       after ? std::optional(*after) : std::nullopt});
  });
  return changes;
}

std::vector<Change> Diff(const Model& a, const Model& b) {
  std::map<std::string, Change> changes;
  for (const auto& [key, value] : a) changes[key] = {key, value, std::nullopt};
  for (const auto& [key, value] : b) {
    changes[key].key = key;
    changes[key].after = value;
  }
  std::vector<Change> list;
  for (auto& [key, change] : changes) {
    if (change.before != change.after) list.push_back(std::move(change));
  }
  return list;
}

TEST(PersistentMap, RandomPathsAgreeWithStdMap) {
  for (uint32_t seed = 1; seed <= 20; ++seed) {
    std::mt19937 random(seed);
    const int keys = seed % 2 == 0 ? 20 : 300;
    std::vector<std::pair<Map, Model>> versions = {{}};
    for (int step = 0; step < 60; ++step) {
      // Starts from any version, not only from the newest.
      auto [map, model] = versions[random() % versions.size()];
      for (uint32_t n = random() % 30; n > 0; --n) {
        const std::string key = absl::StrCat("k", random() % keys);
        if (random() % 3 == 0) {
          EXPECT_EQ(map.Erase(key), model.erase(key) == 1);
        } else {
          const int value = static_cast<int>(random() % 5);
          map.Put(key, value);
          model[key] = value;
        }
        EXPECT_EQ(map.size(), model.size());
      }
      versions.emplace_back(std::move(map), std::move(model));
    }
    for (const auto& [map, model] : versions) ASSERT_EQ(ToModel(map), model);
    for (int n = 0; n < 200; ++n) {
      const auto& [map_a, model_a] = versions[random() % versions.size()];
      const auto& [map_b, model_b] = versions[random() % versions.size()];
      ASSERT_EQ(Diff(map_a, map_b), Diff(model_a, model_b)) << "seed " << seed;
    }
  }
}

TEST(PersistentMap, ADifferenceCanBeTakenUpAnywhere) {
  std::mt19937 random(7);
  for (int round = 0; round < 300; ++round) {
    Map a;
    for (uint32_t n = random() % 60; n > 0; --n) a.Put(absl::StrCat("k", random() % 80), n);
    Map b = random() % 8 == 0 ? Map() : a;
    for (uint32_t n = random() % 60; n > 0; --n) {
      const std::string key = absl::StrCat("k", random() % 80);
      if (random() % 2 == 0) {
        b.Erase(key);
      } else {
        b.Put(key, static_cast<int>(random() % 5));
      }
    }
    const std::vector<Change> whole = Diff(ToModel(a), ToModel(b));
    // In pieces of random size, each starting just beyond the last key of the one before.
    std::vector<Change> pieces;
    std::string from;
    size_t left = 0;
    while (!Map::DiffFrom(a, b, from, [&](const std::string& key, const int* was, const int* is) {
      pieces.push_back(
          {key, was ? std::optional(*was) : std::nullopt, is ? std::optional(*is) : std::nullopt});
      from = key + '\0';
      if (left == 0) left = 1 + random() % 5;
      return --left > 0;
    })) {
    }
    ASSERT_EQ(pieces, whole) << "round " << round;
    // From a key that neither may have.
    from = absl::StrCat("k", random() % 80, "x");
    pieces.clear();
    EXPECT_TRUE(
        Map::DiffFrom(a, b, from, [&](const std::string& key, const int* was, const int* is) {
          pieces.push_back({key, was ? std::optional(*was) : std::nullopt,
                            is ? std::optional(*is) : std::nullopt});
          return true;
        }));
    std::vector<Change> beyond = whole;
    std::erase_if(beyond, [&](const Change& change) { return change.key < from; });
    ASSERT_EQ(pieces, beyond) << "round " << round;
  }
}

TEST(PersistentMap, FindsAndWalksFromAKey) {
  Map map;
  for (const char* key : {"d", "a", "c", "f"}) map.Put(key, key[0]);
  EXPECT_EQ(*map.Find("c"), 'c');
  EXPECT_EQ(map.Find("b"), nullptr);
  const auto from = [&](const std::string& start, size_t most) {
    std::string seen;
    map.ForEachFrom(start, [&](const std::string& key, int) {
      seen += key;
      return seen.size() < most;
    });
    return seen;
  };
  EXPECT_EQ(from("", 9), "acdf");
  EXPECT_EQ(from("b", 9), "cdf");
  EXPECT_EQ(from("c", 2), "cd");
  EXPECT_EQ(from("g", 9), "");
}

TEST(PersistentMap, ACopyStaysAsItWas) {
  Map map;
  for (int i = 0; i < 100; ++i) map.Put(std::to_string(i), i);
  const Map copy = map;
  const Model before = ToModel(map);
  for (int i = 0; i < 100; i += 2) map.Erase(std::to_string(i));
  for (int i = 1; i < 100; i += 2) map.Put(std::to_string(i), -i);
  EXPECT_EQ(ToModel(copy), before);
  EXPECT_EQ(map.size(), 50u);
}

// Counts comparisons of values: equal subtrees must not be searched.
struct Counted {
  int value = 0;
  static inline int comparisons = 0;
  bool operator==(const Counted& other) const {
    ++comparisons;
    return value == other.value;
  }
};

TEST(PersistentMap, ADifferenceCostsWhatDiffers) {
  PersistentMap<int, Counted> a;
  for (int i = 0; i < 100000; ++i) a.Put(i, {i});
  PersistentMap<int, Counted> b = a;
  for (int i = 500; i < 510; ++i) b.Put(i, {-i});
  b.Erase(70000);
  b.Put(100001, {1});
  Counted::comparisons = 0;
  int changes = 0;
  PersistentMap<int, Counted>::Diff(a, b, [&](int, const Counted*, const Counted*) { ++changes; });
  EXPECT_EQ(changes, 12);
  EXPECT_LT(Counted::comparisons, 1000);  // 12 paths of a tree of 100,000
}

TEST(PersistentMap, TakesARangeOfKeysFromAnotherMap) {
  std::mt19937 random(7);
  const auto key = [&] { return absl::StrCat(random() % 60); };
  for (int round = 0; round < 300; ++round) {
    Map mine, theirs;
    for (uint32_t i = random() % 40; i > 0; --i) mine.Put(key(), static_cast<int>(random() % 5));
    if (random() % 2 == 0) theirs = mine;
    for (uint32_t i = random() % 40; i > 0; --i) theirs.Put(key(), static_cast<int>(random() % 5));
    const Model mine_before = ToModel(mine), theirs_before = ToModel(theirs);
    std::string from = key(), to = key();
    if (to < from) std::swap(from, to);
    const Map joined = mine.WithRangeOf(theirs, from, to);
    Model expected;
    for (const auto& [k, value] : mine_before) {
      if (k < from || k >= to) expected[k] = value;
    }
    for (const auto& [k, value] : theirs_before) {
      if (k >= from && k < to) expected[k] = value;
    }
    EXPECT_EQ(ToModel(joined), expected);
    EXPECT_EQ(joined.size(), expected.size());
    EXPECT_EQ(ToModel(mine), mine_before);
    EXPECT_EQ(ToModel(theirs), theirs_before);
    // Its shape is that of any map with these keys, so that differences are found.
    EXPECT_EQ(Diff(joined, mine), Diff(expected, mine_before));
    Map built;
    for (const auto& [k, value] : expected) built.Put(k, value);
    EXPECT_TRUE(Diff(joined, built).empty());
  }
}

TEST(PersistentMap, AMapThatTookARangeSharesWhatItTook) {
  PersistentMap<int, Counted> a, b;
  for (int i = 0; i < 100000; ++i) a.Put(i, {i});
  for (int i = 0; i < 100000; ++i) b.Put(i, {-i});
  const PersistentMap<int, Counted> joined = a.WithRangeOf(b, 1000, 90000);
  Counted::comparisons = 0;
  int changes = 0;
  const PersistentMap<int, Counted> again = a.WithRangeOf(b, 1000, 90000);
  PersistentMap<int, Counted>::Diff(joined, again,
                                    [&](int, const Counted*, const Counted*) { ++changes; });
  EXPECT_EQ(changes, 0);
  EXPECT_LT(Counted::comparisons, 1000);
}

TEST(PersistentMap, VersionsMayBeUsedFromSeveralThreads) {
  Map base;
  for (int i = 0; i < 2000; ++i) base.Put(std::to_string(i), i);
  std::vector<std::thread> threads;
  std::vector<int> sums(4);
  for (int t = 0; t < 4; ++t) {
    threads.emplace_back([copy = base, t, &sums]() mutable {
      for (int i = t; i < 2000; i += 4) copy.Put(std::to_string(i), 0);
      copy.ForEach([&](const std::string&, int value) { sums[t] += value; });
    });
  }
  base = Map();  // released at the same time
  for (std::thread& thread : threads) thread.join();
  const int all = 1999 * 2000 / 2;
  for (int t = 0; t < 4; ++t) {
    int zeroed = 0;
    for (int i = t; i < 2000; i += 4) zeroed += i;
    EXPECT_EQ(sums[t], all - zeroed);
  }
}

}  // namespace
}  // namespace voxeld::daemon
