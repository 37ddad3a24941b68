// Tests programs with one error each: they are refused with a message that names it.
#include "gpu/implicit/program_check.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "gpu/implicit/program.h"

namespace voxeld::gpu::implicit {
namespace {

using ::testing::HasSubstr;

// The layout of gpu/implicit/program.h, implemented a second time.
struct Program {
  uint32_t color_by = 0, surface_slot = 0, bound_slot = 0, color_slots[3] = {}, ring_axis = 0;
  std::vector<Instruction> surface, bound, color;
  std::vector<uint32_t> rings, table;

  std::vector<uint32_t> Words() const {
    std::vector<uint32_t> words = {static_cast<uint32_t>(surface.size()),
                                   static_cast<uint32_t>(bound.size()),
                                   static_cast<uint32_t>(color.size()),
                                   color_by,
                                   surface_slot,
                                   bound_slot,
                                   color_slots[0],
                                   color_slots[1],
                                   color_slots[2],
                                   static_cast<uint32_t>(rings.size()),
                                   ring_axis,
                                   0};
    for (const auto* part : {&surface, &bound, &color}) {
      for (const Instruction& in : *part) words.insert(words.end(), {in.word, in.immediate});
    }
    words.insert(words.end(), rings.begin(), rings.end());
    words.insert(words.end(), table.begin(), table.end());
    return words;
  }
};

Instruction Make(Op op, uint32_t to, uint32_t a = 0, uint32_t b = 0, uint32_t immediate = 0) {
  return Instruction::Of(op, to, a, b, immediate);
}

// Returns a program that has everything: x² + y in slot 2, bounded by z, a colour by channels,
// three positions in two rings.
Program Good() {
  Program program;
  program.surface = {Make(Op::kX, 0), Make(Op::kPowI, 1, 0, 0, 2), Make(Op::kY, 0),
                     Make(Op::kAdd, 2, 0, 1)};
  program.surface_slot = 2;
  program.bound = {Make(Op::kZ, 23)};
  program.bound_slot = 23;
  program.color_by = 1;
  program.color = {Make(Op::kX, 0), Make(Op::kY, 1), Make(Op::kConstant, 2)};
  for (uint32_t i = 0; i < 3; ++i) program.color_slots[i] = i;
  program.rings = {1, 3};
  return program;
}
constexpr uint32_t kPositions = 3;

std::string Why(const Program& program, uint32_t positions = kPositions) {
  return std::string(CheckProgram(program.Words(), positions).message());
}

TEST(ProgramCheck, WhatIsRightIsTaken) {
  EXPECT_EQ(Why(Good()), "");
  Program program = Good();
  program.color_by = 2;
  program.color_slots[1] = program.color_slots[2] = 99;  // with a table, only the first counts
  program.table.resize(256);
  EXPECT_EQ(Why(program), "");
  program.surface[1].immediate = 1024;
  EXPECT_EQ(Why(program), "");
  program.surface[1].immediate = static_cast<uint32_t>(-1024);
  EXPECT_EQ(Why(program), "");
  program.rings = {0, 0, 3, 3};
  EXPECT_EQ(Why(program), "");
  program = Good();
  program.surface.assign(1024, Make(Op::kX, 2));
  program.bound.assign(1024, Make(Op::kX, 23));
  program.color.insert(program.color.begin(), 1021, Make(Op::kX, 5));
  EXPECT_EQ(Why(program), "");
}

struct Case {
  std::function<void(Program&)> spoil;
  const char* words;
};

TEST(ProgramCheck, EachFaultIsNamed) {
  const Case cases[] = {
      {[](Program& p) { p.surface.clear(); }, "surface is 0, must be 1 to 1024"},
      {[](Program& p) { p.surface.assign(1025, Make(Op::kX, 2)); }, "surface is 1025"},
      {[](Program& p) { p.bound.assign(1025, Make(Op::kX, 23)); }, "bound is 1025"},
      {[](Program& p) { p.color.assign(1025, Make(Op::kX, 0)); }, "color is 1025"},
      {[](Program& p) { p.color_by = 3; }, "color_by is 3"},
      {[](Program& p) { p.color_by = 0; }, "color_by is 0"},
      {[](Program& p) { p.color.clear(); }, "color_by is 1"},
      {[](Program& p) { p.ring_axis = 3; }, "ring_axis is 3"},
      {[](Program& p) { p.table.resize(1); }, "size is 31, must be 30 words"},
      {[](Program& p) { p.color_by = 2; }, "size is 30, must be 286 words"},
      {[](Program& p) { p.surface[2] = Make(static_cast<Op>(24), 0); },
       "surface, instruction 2: op is 24"},
      {[](Program& p) { p.bound[0] = Make(Op::kHoisted, 23); }, "bound, instruction 0: op is 5"},
      {[](Program& p) { p.color[1] = Make(static_cast<Op>(255), 1); },
       "color, instruction 1: op is 255"},
      {[](Program& p) { p.surface[0] = Make(Op::kX, 24); }, "slot is 24, must be 0 to 23"},
      {[](Program& p) { p.surface[0] = Make(Op::kX, 0, 24); }, "slot is 24, must be 0 to 23"},
      {[](Program& p) { p.surface[0] = Make(Op::kX, 0, 0, 24); }, "slot is 24, must be 0 to 23"},
      {[](Program& p) { p.surface[3] = Make(Op::kAdd, 2, 3, 1); },
       "instruction 3: slot read is 3, must be one that has been written"},
      {[](Program& p) { p.surface[3] = Make(Op::kAdd, 2, 1, 3); },
       "instruction 3: slot read is 3, must be one that has been written"},
      {[](Program& p) { p.surface[3] = Make(Op::kAdd, 1, 0, 1); },
       "instruction 3: slot written is 1, must be none that is read"},
      {[](Program& p) { p.surface[3] = Make(Op::kAdd, 0, 0, 1); },
       "instruction 3: slot written is 0, must be none that is read"},
      {[](Program& p) { p.surface[1].immediate = 1025; }, "exponent is 1025"},
      {[](Program& p) { p.surface[1].immediate = static_cast<uint32_t>(-1025); },
       "exponent is -1025"},
      {[](Program& p) { p.surface[1].immediate = 0x80000000; }, "exponent is -2147483648"},
      {[](Program& p) { p.surface_slot = 3; }, "surface, slot of the result is 3"},
      {[](Program& p) { p.bound_slot = 24; }, "bound, slot of the result is 24"},
      // Each of the three begins with empty slots.
      {[](Program& p) { p.bound_slot = 0; }, "bound, slot of the result is 0"},
      {[](Program& p) { p.color_slots[2] = 0xFFFFFFFF; },
       "color, slot of the result is 4294967295"},
      {[](Program& p) {
         p.rings = {2, 1, 3};
       },
       "program: ring end is 1, must be no less"},
      {[](Program& p) {
         p.rings = {1, 2};
       },
       "last ring end is 2, must be 3"},
      {[](Program& p) {
         p.rings = {1, 4};
       },
       "last ring end is 4, must be 3"},
  };
  for (const Case& one : cases) {
    Program program = Good();
    one.spoil(program);
    EXPECT_THAT(Why(program), HasSubstr(one.words));
  }
}

TEST(ProgramCheck, AColoursResultIsAskedForOfEitherKind) {
  Program program = Good();
  program.color_by = 2;
  program.table.resize(256);
  program.color = {Make(Op::kX, 7)};
  program.color_slots[0] = 7;
  EXPECT_EQ(Why(program), "");
  program.color_slots[0] = 6;
  EXPECT_THAT(Why(program), HasSubstr("color, slot of the result is 6"));
}

TEST(ProgramCheck, AProgramThatIsCutIsRefused) {
  const std::vector<uint32_t> words = Good().Words();
  for (size_t cut = 0; cut < words.size(); ++cut) {
    EXPECT_FALSE(CheckProgram({words.data(), cut}, kPositions).ok()) << cut;
  }
}

}  // namespace
}  // namespace voxeld::gpu::implicit
