// An ordered map whose copies are cheap and share structure: a copy costs O(1), a change after it
// O(log n), and the difference of any two costs what differs (times log n).
//
// A treap whose priorities are the keys' hashes: the set of keys alone decides its shape, so two
// maps that were changed along different paths still have equal subtrees where their content is
// equal, and those that share them are recognised by address. A node that nobody else holds is
// changed in place.
//
// Threads: as a value. Distinct maps may share nodes and be used from different threads at once.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <utility>

#include "absl/hash/hash.h"

namespace voxeld::daemon {

// K: ordered by <, hashed by absl::Hash. V: copyable, compared by == (for Diff only).
template <typename K, typename V>
class PersistentMap {
 public:
  size_t size() const { return size_; }
  bool empty() const { return size_ == 0; }

  // Valid until this map is next changed.
  const V* Find(const K& key) const {
    const Node* node = root_.get();
    while (node != nullptr) {
      if (key < node->key) {
        node = node->left.get();
      } else if (node->key < key) {
        node = node->right.get();
      } else {
        return &node->value;
      }
    }
    return nullptr;
  }
  bool Contains(const K& key) const { return Find(key) != nullptr; }

  // Inserts, or replaces the value of an equal key.
  void Put(const K& key, V value) { PutAt(root_, key, std::move(value), absl::Hash<K>()(key)); }

  // False if there was none.
  bool Erase(const K& key) {
    if (!Contains(key)) return false;
    EraseAt(root_, key);
    --size_;
    return true;
  }

  // fn(const K&, const V&), ascending.
  template <typename Fn>
  void ForEach(Fn&& fn) const {
    Visit(root_.get(), fn);
  }

  // fn(const K&, const V&) → whether to go on; ascending
  // from the first key that is not less than `from`.
  template <typename Fn>
  void ForEachFrom(const K& from, Fn&& fn) const {
    VisitFrom(root_.get(), from, fn);
  }

  // fn(const K&, const V* before, const V* after) for every key whose value differs, ascending;
  // null where a map has none.
  template <typename Fn>
  static void Diff(const PersistentMap& before, const PersistentMap& after, Fn&& fn) {
    const auto always = [&fn](const K& key, const V* was, const V* is) {
      fn(key, was, is);
      return true;
    };
    DiffAt(before.root_, after.root_, nullptr, always);
  }

  // The same for keys that are not less than `from`, until `fn` answers false: then the answer is
  // false. Taking it up again at the next key costs O(log² n).
  template <typename Fn>
  static bool DiffFrom(const PersistentMap& before, const PersistentMap& after, const K& from,
                       Fn&& fn) {
    return DiffAt(before.root_, after.root_, &from, fn);
  }

 private:
  struct Node;

  // A counted reference. The count is read with acquire before a node is changed in place, so
  // whatever another thread read before it let go has happened.
  class Ref {
   public:
    Ref() = default;
    explicit Ref(Node* node) : node_(node) {}  // takes over the first count
    Ref(const Ref& other) : node_(other.node_) {
      if (node_ != nullptr) node_->refs.fetch_add(1, std::memory_order_relaxed);
    }
    Ref(Ref&& other) noexcept : node_(std::exchange(other.node_, nullptr)) {}
    Ref& operator=(Ref other) noexcept {
      std::swap(node_, other.node_);
      return *this;
    }
    ~Ref() {
      if (node_ != nullptr && node_->refs.fetch_sub(1, std::memory_order_acq_rel) == 1)
        delete node_;
    }

    Node* get() const { return node_; }
    Node* operator->() const { return node_; }
    explicit operator bool() const { return node_ != nullptr; }
    bool unique() const { return node_->refs.load(std::memory_order_acquire) == 1; }

   private:
    Node* node_ = nullptr;
  };

  struct Node {
    Node(const K& k, V v, size_t p) : key(k), value(std::move(v)), priority(p) {}
    Node(const Node& other)
        : key(other.key),
          value(other.value),
          priority(other.priority),
          left(other.left),
          right(other.right) {}

    const K key;
    V value;
    const size_t priority;
    Ref left, right;
    std::atomic<uint32_t> refs{1};
  };

  // The node of `ref`, copied first if others hold it too.
  static Node* Own(Ref& ref) {
    if (!ref.unique()) ref = Ref(new Node(*ref.get()));
    return ref.get();
  }

  // Which of two keys stands above the other: a total order, so that the shape is unique.
  static bool Above(size_t priority_a, const K& a, size_t priority_b, const K& b) {
    return priority_a != priority_b ? priority_a > priority_b : a < b;
  }

  void PutAt(Ref& at, const K& key, V value, size_t priority) {
    if (at && !(key < at->key) && !(at->key < key)) {
      Own(at)->value = std::move(value);
      return;
    }
    if (at && Above(at->priority, at->key, priority, key)) {
      Node* node = Own(at);
      PutAt(key < node->key ? node->left : node->right, key, std::move(value), priority);
      return;
    }
    // Had the key been here, it would have stood at or above this place.
    Node* node = new Node(key, std::move(value), priority);
    std::pair<Ref, Ref> parts = Split(std::move(at), key);
    node->left = std::move(parts.first);
    node->right = std::move(parts.second);
    at = Ref(node);
    ++size_;
  }

  static void EraseAt(Ref& at, const K& key) {
    if (key < at->key) return EraseAt(Own(at)->left, key);
    if (at->key < key) return EraseAt(Own(at)->right, key);
    if (at.unique()) {
      at = Merge(std::move(at->left), std::move(at->right));
    } else {
      at = Merge(at->left, at->right);
    }
  }

  // Those less than `key`, and those greater; an equal one is left out.
  static std::pair<Ref, Ref> Split(Ref at, const K& key) {
    if (!at) return {};
    if (at->key < key) {
      Node* node = Own(at);
      auto [less, greater] = Split(std::move(node->right), key);
      node->right = std::move(less);
      return {std::move(at), std::move(greater)};
    }
    if (key < at->key) {
      Node* node = Own(at);
      auto [less, greater] = Split(std::move(node->left), key);
      node->left = std::move(greater);
      return {std::move(less), std::move(at)};
    }
    return {at->left, at->right};
  }

  // Every key of `a` is less than every key of `b`.
  static Ref Merge(Ref a, Ref b) {
    if (!a) return b;
    if (!b) return a;
    if (Above(a->priority, a->key, b->priority, b->key)) {
      Node* node = Own(a);
      node->right = Merge(std::move(node->right), std::move(b));
      return a;
    }
    Node* node = Own(b);
    node->left = Merge(std::move(a), std::move(node->left));
    return b;
  }

  template <typename Fn>
  static void Visit(const Node* node, Fn& fn) {
    if (node == nullptr) return;
    Visit(node->left.get(), fn);
    fn(node->key, node->value);
    Visit(node->right.get(), fn);
  }

  template <typename Fn>
  static bool VisitFrom(const Node* node, const K& from, Fn& fn) {
    if (node == nullptr) return true;
    if (node->key < from) return VisitFrom(node->right.get(), from, fn);
    return VisitFrom(node->left.get(), from, fn) && fn(node->key, node->value) &&
           VisitAll(node->right.get(), fn);
  }

  template <typename Fn>
  static bool VisitAll(const Node* node, Fn& fn) {
    return node == nullptr || (VisitAll(node->left.get(), fn) && fn(node->key, node->value) &&
                               VisitAll(node->right.get(), fn));
  }

  // `from` null: all. Everything right of a key that is not less than `from` is beyond it too.
  template <typename Fn>
  static bool DiffAt(const Ref& a, const Ref& b, const K* from, Fn& fn) {
    if (a.get() == b.get()) return true;
    if (!a || (b && Above(b->priority, b->key, a->priority, a->key))) {
      // b's root is not in a: it would stand at the top.
      const auto [less, greater] = Split(a, b->key);
      if (from != nullptr && b->key < *from) return DiffAt(greater, b->right, from, fn);
      return DiffAt(less, b->left, from, fn) && fn(b->key, nullptr, &b->value) &&
             DiffAt(greater, b->right, nullptr, fn);
    }
    if (!b || Above(a->priority, a->key, b->priority, b->key)) {
      const auto [less, greater] = Split(b, a->key);
      if (from != nullptr && a->key < *from) return DiffAt(a->right, greater, from, fn);
      return DiffAt(a->left, less, from, fn) && fn(a->key, &a->value, nullptr) &&
             DiffAt(a->right, greater, nullptr, fn);
    }
    if (from != nullptr && a->key < *from) return DiffAt(a->right, b->right, from, fn);
    return DiffAt(a->left, b->left, from, fn) &&
           (a->value == b->value || fn(a->key, &a->value, &b->value)) &&
           DiffAt(a->right, b->right, nullptr, fn);
  }

  Ref root_;
  size_t size_ = 0;
};

}  // namespace voxeld::daemon
