// Two sessions of one owner share layers and objects; and the effect of `strict`.
#include "example.h"

using namespace voxeld::client;        // NOLINT
using namespace std::chrono_literals;  // NOLINT

absl::Status Run(const std::string& address) {
  auto first = Session::Open({.address = address, .client_name = "first"});
  if (!first.ok()) return first.status();
  auto ball = (*first)->GetLayer("shared").Put("ball", Sphere{.radius = 0.4});
  if (!ball.ok()) return ball.status();
  auto frame = (*first)->Commit();
  if (!frame.ok()) return frame.status();
  if (auto put = (*first)->WaitAccepted(*frame, 10s); !put.ok()) return put.status();

  auto second = Session::Open({.address = address,
                               .client_name = "second",
                               .strict = true,
                               .owner_token = (*first)->server()->owner_token});
  if (!second.ok()) return second.status();
  if (absl::Status opened = (*second)->WaitOpened(10s); !opened.ok()) return opened;
  std::printf("one owner: %s\n",
              (*first)->server()->owner == (*second)->server()->owner ? "yes" : "no");
  // The second session moves what the first has drawn.
  const Layer shared = (*second)->GetLayer("shared");
  if (absl::Status moved = shared.SetTransform("ball", Affine::Translate({0.2, 0, 0})); !moved.ok())
    return moved;
  frame = (*second)->Commit();
  if (!frame.ok()) return frame.status();
  if (auto moved = (*second)->WaitAccepted(*frame, 10s); !moved.ok()) return moved.status();
  std::printf("moved by the other\n");

  // Strict: one bad operation refuses its whole commit, and the answer names it.
  if (auto good = shared.Put("good", Box{}); !good.ok()) return good.status();
  if (auto bad = shared.Put("bad", Sphere{.radius = -1}); !bad.ok()) return bad.status();
  frame = (*second)->Commit();
  if (!frame.ok()) return frame.status();
  auto refused = (*second)->WaitAccepted(*frame, 10s);
  std::printf("%s\n", refused.ok() ? "accepted?" : std::string(refused.status().message()).c_str());
  // Not strict: the rest of the commit is applied.
  if (auto bad = (*first)->GetLayer("shared").Put("bad", Sphere{.radius = -1}); !bad.ok())
    return bad.status();
  if (auto good = (*first)->GetLayer("shared").Put("good", Box{}); !good.ok()) return good.status();
  frame = (*first)->Commit();
  if (!frame.ok()) return frame.status();
  auto partly = (*first)->WaitAccepted(*frame, 10s);
  if (!partly.ok()) return partly.status();
  std::printf("not strict: %llu refused, the rest is up\n",
              static_cast<unsigned long long>(partly->refused_operations));
  if (absl::Status closed = (*second)->Close(); !closed.ok()) return closed;
  return (*first)->Close();
}

int main(int argc, char** argv) { return RunExample(argc, argv, Run); }
