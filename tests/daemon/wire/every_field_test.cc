// Finds every number and every enumerated value of every kind of primitive by reflection: a number
// that single precision cannot represent, or an unknown enumerated value, is refused, by the name
// of the field. No list of fields is kept here, so an added field is tested as well.
#include <gmock/gmock.h>
#include <google/protobuf/descriptor.h>
#include <google/protobuf/message.h>

#include <functional>
#include <limits>
#include <string>

#include "absl/strings/str_cat.h"
#include "daemon/text/fonts.h"
#include "daemon/wire/primitive.h"
#include "tests/daemon/wire/full_primitives.h"

namespace voxeld::daemon::wire {
namespace every_field_test {

using google::protobuf::FieldDescriptor;
using google::protobuf::Message;
using ::testing::HasSubstr;

MaybeFault FaultOf(const v1::Primitive& primitive) {
  static text::Fonts fonts;
  const Limits limits;
  Content content;
  return ToContent(FieldPath("primitive"), primitive, {.limits = limits, .fonts = &fonts},
                   &content);
}

// Calls visit(message, field, index or -1, path) for each scalar of `root` that is set, or that has
// no presence; absent messages are left out.
using Visit = std::function<void(Message*, const FieldDescriptor*, int, const std::string&)>;
void ForEachField(Message* message, const std::string& path, const Visit& visit) {
  const auto* reflection = message->GetReflection();
  for (int i = 0; i < message->GetDescriptor()->field_count(); ++i) {
    const FieldDescriptor* const field = message->GetDescriptor()->field(i);
    const std::string name = absl::StrCat(path, ".", field->name());
    if (field->cpp_type() == FieldDescriptor::CPPTYPE_MESSAGE) {
      if (field->is_repeated() || !reflection->HasField(*message, field)) continue;
      ForEachField(reflection->MutableMessage(message, field), name, visit);
    } else if (field->is_repeated()) {
      for (int k = 0; k < reflection->FieldSize(*message, field); ++k)
        visit(message, field, k, absl::StrCat(name, "[", k, "]"));
    } else if (!field->has_presence() || reflection->HasField(*message, field)) {
      visit(message, field, -1, name);
    }
  }
}

std::string KindOf(const v1::Primitive& primitive) {
  return v1::Primitive::descriptor()->FindFieldByNumber(primitive.kind_case())->name();
}

TEST(EveryField, FullPrimitivesAreGoodAndOfEveryKind) {
  std::set<std::string> kinds;
  for (const v1::Primitive& primitive : FullPrimitives()) {
    const MaybeFault fault = FaultOf(primitive);
    EXPECT_FALSE(fault.has_value())
        << primitive.ShortDebugString() << fault->field << " " << fault->message;
    kinds.insert(KindOf(primitive));
  }
  EXPECT_EQ(kinds.size(), v1::Primitive::descriptor()->oneof_decl(0)->field_count());
}

TEST(EveryField, WhatIsNoNumberIsRefusedByName) {
  int tried = 0;
  for (const v1::Primitive& good : FullPrimitives()) {
    v1::Primitive spoilt = good;
    ForEachField(
        &spoilt, "primitive",
        [&](Message* message, const FieldDescriptor* field, int index, const std::string& path) {
          const auto* reflection = message->GetReflection();
          const bool is_double = field->cpp_type() == FieldDescriptor::CPPTYPE_DOUBLE;
          if (!is_double && field->cpp_type() != FieldDescriptor::CPPTYPE_FLOAT) return;
          for (const double value :
               {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity(),
                -std::numeric_limits<double>::infinity(), 1e39}) {
            if (!is_double && value == 1e39) continue;  // not a float
            SCOPED_TRACE(absl::StrCat(path, " = ", value));
            double was = 0;
            if (index >= 0) {
              was = reflection->GetRepeatedDouble(*message, field, index);
              reflection->SetRepeatedDouble(message, field, index, value);
            } else if (is_double) {
              was = reflection->GetDouble(*message, field);
              reflection->SetDouble(message, field, value);
            } else {
              was = reflection->GetFloat(*message, field);
              reflection->SetFloat(message, field, static_cast<float>(value));
            }
            const MaybeFault fault = FaultOf(spoilt);
            ASSERT_TRUE(fault.has_value());
            EXPECT_EQ(fault->field, path) << fault->message;
            EXPECT_EQ(fault->reason, Reason::kInvalidValue);
            if (index >= 0) {
              reflection->SetRepeatedDouble(message, field, index, was);
            } else if (is_double) {
              reflection->SetDouble(message, field, was);
            } else {
              reflection->SetFloat(message, field, static_cast<float>(was));
            }
            ++tried;
          }
        });
    if (HasFatalFailure()) return;
  }
  EXPECT_GT(tried, 500);
}

TEST(EveryField, AnUnknownValueIsRefusedByName) {
  int tried = 0;
  for (const v1::Primitive& good : FullPrimitives()) {
    v1::Primitive spoilt = good;
    ForEachField(
        &spoilt, "primitive",
        [&](Message* message, const FieldDescriptor* field, int index, const std::string& path) {
          const auto* reflection = message->GetReflection();
          if (field->cpp_type() != FieldDescriptor::CPPTYPE_ENUM) return;
          SCOPED_TRACE(path);
          // Their types mean nothing without such arrays.
          if (field->name() == "color_type" || field->name() == "index_type" ||
              field->name() == "colors_of")
            return;
          const int was = index < 0 ? reflection->GetEnumValue(*message, field)
                                    : reflection->GetRepeatedEnumValue(*message, field, index);
          const auto set = [&](int value) {
            if (index < 0) {
              reflection->SetEnumValue(message, field, value);
            } else {
              reflection->SetRepeatedEnumValue(message, field, index, value);
            }
          };
          set(77);
          const MaybeFault fault = FaultOf(spoilt);
          ASSERT_TRUE(fault.has_value());
          EXPECT_EQ(fault->field, path) << fault->message;
          EXPECT_EQ(fault->reason, Reason::kInvalidValue);
          EXPECT_THAT(fault->message, HasSubstr("unknown value 77"));
          set(was);
          ++tried;
        });
    if (HasFatalFailure()) return;
  }
  EXPECT_GT(tried, 60);
}

TEST(EveryField, AColourBeyond24BitsIsRefusedByName) {
  int tried = 0;
  for (const v1::Primitive& good : FullPrimitives()) {
    v1::Primitive spoilt = good;
    ForEachField(
        &spoilt, "primitive",
        [&](Message* message, const FieldDescriptor* field, int index, const std::string& path) {
          if (field->type() != FieldDescriptor::TYPE_FIXED32) return;
          SCOPED_TRACE(path);
          const auto* reflection = message->GetReflection();
          const auto set = [&](uint32_t value) {
            if (index < 0) {
              reflection->SetUInt32(message, field, value);
            } else {
              reflection->SetRepeatedUInt32(message, field, index, value);
            }
          };
          set(0xFFFFFF);
          EXPECT_FALSE(FaultOf(spoilt).has_value());
          set(0x1000000);
          const MaybeFault fault = FaultOf(spoilt);
          ASSERT_TRUE(fault.has_value());
          EXPECT_EQ(fault->field, path) << fault->message;
          EXPECT_EQ(fault->reason, Reason::kInvalidValue);
          EXPECT_THAT(fault->message, HasSubstr("0x1000000"));
          set(1);
          ++tried;
        });
    if (HasFatalFailure()) return;
  }
  EXPECT_GT(tried, 10);
}

}  // namespace every_field_test
}  // namespace voxeld::daemon::wire
