#pragma once

#include <cstddef>

namespace thrust {

// Iterates over the results of `function` for an array's values.
template <typename Function, typename Iterator>
struct transform_iterator {
  Iterator from;
  Function function;
  auto operator[](size_t i) const { return function(from[i]); }
};

template <typename Function, typename Iterator>
transform_iterator<Function, Iterator> make_transform_iterator(Iterator from, Function function) {
  return {from, function};
}

}  // namespace thrust
