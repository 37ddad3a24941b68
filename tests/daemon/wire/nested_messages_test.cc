// Checks that clients cannot send messages of unbounded nesting depth: no protocol message contains itself, and deeply nested unknown
// fields are rejected before parsing them could overflow the stack.
#include <google/protobuf/descriptor.h>
#include <google/protobuf/descriptor.pb.h>
#include <google/protobuf/message.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "tests/small_stack.h"
#include "voxeld/v1/display.pb.h"
#include "voxeld/v1/scene.pb.h"

namespace voxeld::daemon::wire {
namespace nested_messages_test {

using google::protobuf::Descriptor;
using google::protobuf::FieldDescriptor;

// Returns the maximum nesting depth of `message`, or −1 if a message contains itself. `found` maps each visited message to its depth; 0
// means in progress.
int Depth(const Descriptor* message, std::map<const Descriptor*, int>& found) {
  const auto [place, is_new] = found.emplace(message, 0);
  if (!is_new) return place->second == 0 ? -1 : place->second;
  int most = 0;
  for (int i = 0; i < message->field_count(); ++i) {
    const FieldDescriptor* field = message->field(i);
    if (field->cpp_type() != FieldDescriptor::CPPTYPE_MESSAGE) continue;
    const int depth = Depth(field->message_type(), found);
    if (depth < 0) return -1;
    most = std::max(most, depth);
  }
  return found[message] = most + 1;
}

// Returns the messages that services accept.
std::vector<const Descriptor*> Requests() {
  std::vector<const Descriptor*> all;
  for (const auto* file :
       {v1::StreamRequest::descriptor()->file(), v1::ListDisplaysRequest::descriptor()->file()}) {
    for (int i = 0; i < file->service_count(); ++i) {
      for (int k = 0; k < file->service(i)->method_count(); ++k)
        all.push_back(file->service(i)->method(k)->input_type());
    }
  }
  return all;
}

TEST(NestedMessages, NoMessageContainsItself) {
  std::map<const Descriptor*, int> found;
  ASSERT_GT(Requests().size(), 10u);
  for (const Descriptor* request : Requests()) {
    const int depth = Depth(request, found);
    EXPECT_GT(depth, 0) << request->full_name() << " contains itself";
    EXPECT_LE(depth, 16) << request->full_name();
  }
}

TEST(NestedMessages, AMessageThatContainsItselfIsFound) {
  std::map<const Descriptor*, int> found;
  EXPECT_EQ(Depth(google::protobuf::DescriptorProto::descriptor(), found), -1);
}

// Groups are the only fields of unknown number whose content is parsed.
TEST(NestedMessages, DeepUnknownGroupsAreRejectedWithoutStackOverflow) {
  const std::string begin("\x83\x7d", 2), end("\x84\x7d", 2);  // field 2000
  for (const Descriptor* request : Requests()) {
    OnSmallStack([&] {
      for (int depth = 1; depth <= 1 << 16; depth *= 2) {
        std::string bytes;
        for (int i = 0; i < depth; ++i) bytes += begin;
        for (int i = 0; i < depth; ++i) bytes += end;
        const std::unique_ptr<google::protobuf::Message> message(
            google::protobuf::MessageFactory::generated_factory()->GetPrototype(request)->New());
        EXPECT_EQ(message->ParseFromString(bytes), depth < 100)
            << depth << " in " << request->full_name();
      }
    });
  }
}

}  // namespace nested_messages_test
}  // namespace voxeld::daemon::wire
