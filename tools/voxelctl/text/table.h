// Tables for people.
#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

namespace voxeld::voxelctl {

// Rows of cells under a heading; a column is as wide as its widest cell. Cells are escaped.
class Table {
 public:
  enum class Align : uint8_t { kLeft, kRight };
  struct Column {
    std::string heading;
    Align align = Align::kLeft;
  };
  explicit Table(std::vector<Column> columns) : columns_(std::move(columns)) {}

  // Requires: as many cells as columns.
  void Add(std::vector<std::string> cells);

  std::string Text() const;

 private:
  std::vector<Column> columns_;
  std::vector<std::vector<std::string>> rows_;
};

// Returns a number with its noun: "1 volume", "1,234 volumes"; `many` is the plural if adding an s
// is not enough.
std::string Counted(uint64_t count, const std::string& one, const std::string& many = "");

// Return "1,234,567"; "12.3 MB"; "4.56 ms", "–" for 0; "1 h 02 min".
std::string Grouped(uint64_t value);
std::string Bytes(uint64_t value);
std::string Duration(int64_t nanoseconds);

}  // namespace voxeld::voxelctl
