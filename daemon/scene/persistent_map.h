// An ordered map whose copies are cheap and share structure. A copy costs O(1), a subsequent change
// O(log n), and computing a difference costs O(log n) per difference.
//
// It is a treap whose priorities are the keys' hashes. Its shape depends only on the set of keys,
// so two maps that were changed differently still have equal subtrees where their content is equal,
// and shared subtrees are recognised by address. A node with a single owner is changed in place.
//
// Thread safety is that of a value: distinct maps may share nodes and be used by different threads
// concurrently.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <utility>

#include "absl/hash/hash.h"

namespace voxeld::daemon {

// Requires: K is ordered by < and hashed by absl::Hash; V is copyable, and compared by == (for Diff
// only).
template <typename K, typename V>
class PersistentMap {
 public:
  size_t size() const { return size_; }
  bool empty() const { return size_ == 0; }

  // Returns: a pointer that is valid until this map changes; null if the key is missing.
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

  // Inserts the value, or replaces the value of an equal key.
  void Put(const K& key, V value) { PutAt(root_, key, std::move(value), absl::Hash<K>()(key)); }

  // Returns: false if the key is missing.
  bool Erase(const K& key) {
    if (!Contains(key)) return false;
    EraseAt(root_, key);
    --size_;
    return true;
  }

  // Returns a copy in which the keys from `from` to just before `to` are those of `other`. Costs O(log n) and a visit to
  // each of these keys in both maps.
  PersistentMap WithRangeOf(const PersistentMap& other, const K& from, const K& to) const {
    auto [below, not_below] = SplitBefore(root_, from);
    auto [mine, above] = SplitBefore(std::move(not_below), to);
    auto [theirs_below, theirs_not_below] = SplitBefore(other.root_, from);
    auto [theirs, theirs_above] = SplitBefore(std::move(theirs_not_below), to);
    PersistentMap joined;
    joined.size_ = size_ - Count(mine.get()) + Count(theirs.get());
    joined.root_ = Merge(Merge(std::move(below), std::move(theirs)), std::move(above));
    return joined;
  }

  // fn(const K&, const V&), ascending.
  template <typename Fn>
  void ForEach(Fn&& fn) const {
    Visit(root_.get(), fn);
  }

  // Calls fn(const K&, const V&) in ascending order, from the first key that is not less than
  // `from`, until it returns false.
  template <typename Fn>
  void ForEachFrom(const K& from, Fn&& fn) const {
    VisitFrom(root_.get(), from, fn);
  }

  // Calls fn(const K&, const V* before, const V* after) in ascending order for every key whose
  // value differs. A pointer is null if that map lacks the key.
  template <typename Fn>
  static void Diff(const PersistentMap& before, const PersistentMap& after, Fn&& fn) {
    const auto always = [&fn](const K& key, const V* was, const V* is) {
      fn(key, was, is);
      return true;
    };
    DiffAt(before.root_, after.root_, nullptr, always);
  }

  // Does the same for keys that are not less than `from`, until `fn` returns false. Returns: false
  // if `fn` did. Resuming at the next key costs O(log² n).
  template <typename Fn>
  static bool DiffFrom(const PersistentMap& before, const PersistentMap& after, const K& from,
                       Fn&& fn) {
    return DiffAt(before.root_, after.root_, &from, fn);
  }

 private:
  struct Node;

  // A reference that is counted. The count is read with acquire order before a node is changed in
  // place, so reads by other threads that have released the node happen before the change.
  class Ref {
   public:
    Ref() = default;
    explicit Ref(Node* node) : node_(node) {}  // adopts the initial count
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

  // Returns: the node of `ref`, copied first if it is shared.
  static Node* Own(Ref& ref) {
    if (!ref.unique()) ref = Ref(new Node(*ref.get()));
    return ref.get();
  }

  // Returns: which of two keys is the ancestor. This is a total order, so that the shape is unique.
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
    // If the key existed, it would be at or above this place.
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

  // Returns: the nodes with keys less than `key`, and those with greater keys. A node with an equal
  // key is omitted.
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

  // Those less than `key`, and the others.
  static std::pair<Ref, Ref> SplitBefore(Ref at, const K& key) {
    if (!at) return {};
    Node* node = Own(at);
    if (at->key < key) {
      auto [less, others] = SplitBefore(std::move(node->right), key);
      node->right = std::move(less);
      return {std::move(at), std::move(others)};
    }
    auto [less, others] = SplitBefore(std::move(node->left), key);
    node->left = std::move(others);
    return {std::move(less), std::move(at)};
  }

  static size_t Count(const Node* node) {
    return node == nullptr ? 0 : 1 + Count(node->left.get()) + Count(node->right.get());
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

  // `from` null: all keys. Everything to the right of a key that is not less than `from` also
  // qualifies.
  template <typename Fn>
  static bool DiffAt(const Ref& a, const Ref& b, const K* from, Fn& fn) {
    if (a.get() == b.get()) return true;
    if (!a || (b && Above(b->priority, b->key, a->priority, a->key))) {
      // `a` does not contain b's root, or it would be at the top.
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
