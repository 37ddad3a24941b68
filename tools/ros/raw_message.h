// A message of visualization_msgs as received bytes: roscpp passes them on unparsed, so that
// unreadable messages can be counted.
#pragma once

#include <ros/builtin_message_traits.h>
#include <ros/message_traits.h>
#include <ros/serialization.h>

#include <cstdint>
#include <cstring>
#include <vector>

#include "tools/ros/messages.h"

namespace voxeld::ros1 {

// `Message` is the message type, whose MD5 publishers are asked for.
template <typename Message>
struct RawMessage {
  std::vector<uint8_t> bytes;
};

}  // namespace voxeld::ros1

namespace ros {
namespace message_traits {

template <typename Message>
struct IsMessage<voxeld::ros1::RawMessage<Message>> : TrueType {};
template <typename Message>
struct MD5Sum<voxeld::ros1::RawMessage<Message>> : MD5Sum<Message> {
  static const char* value() { return MD5Sum<Message>::value(); }
  static const char* value(const voxeld::ros1::RawMessage<Message>&) { return value(); }
};
template <typename Message>
struct DataType<voxeld::ros1::RawMessage<Message>> {
  static const char* value() { return DataType<Message>::value(); }
  static const char* value(const voxeld::ros1::RawMessage<Message>&) { return value(); }
};
template <typename Message>
struct Definition<voxeld::ros1::RawMessage<Message>> {
  static const char* value() { return Definition<Message>::value(); }
  static const char* value(const voxeld::ros1::RawMessage<Message>&) { return value(); }
};

}  // namespace message_traits

namespace serialization {

template <typename Message>
struct Serializer<voxeld::ros1::RawMessage<Message>> {
  template <typename Stream>
  static void read(Stream& stream, voxeld::ros1::RawMessage<Message>& message) {
    const uint32_t size = stream.getLength();
    const uint8_t* from = stream.advance(size);
    message.bytes.assign(from, from + size);
  }
};

}  // namespace serialization
}  // namespace ros
