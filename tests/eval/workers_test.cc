#include "eval/run/workers.h"

#include <gtest/gtest.h>

#include <new>
#include <stdexcept>

namespace tsdfpp {
namespace {

// Says so when it is destroyed: in a child that would be what the parent holds.
struct Witness {
  explicit Witness(Channel*& channel) : channel_(channel) {}
  ~Witness() {
    if (channel_ != nullptr) channel_->Send("unwound");
  }
  Channel*& channel_;
};

Expected<std::optional<Workers::Message>> FirstOf(const Workers::Body& body) {
  auto workers = Workers::Start(1, body);
  if (!workers) return tl::unexpected(workers.error());
  return workers->Next();
}

// An exception must neither unwind the copies of the parent's objects nor end as a signal.
TEST(Workers, WhatAChildThrowsIsAnErrorOfTheParents) {
  Channel* in_child = nullptr;
  const Witness witness(in_child);
  const auto memory = FirstOf([&](Channel& channel) -> Expected<void> {
    in_child = &channel;
    throw std::bad_alloc();
  });
  ASSERT_FALSE(memory.has_value()) << (*memory ? (*memory)->line : "no message");
  EXPECT_EQ(memory.error().kind, ErrorKind::kEnvironment);
  EXPECT_TRUE(memory.error().message.starts_with("out of memory")) << memory.error().message;
  const auto other =
      FirstOf([](Channel&) -> Expected<void> { throw std::runtime_error("two\nlines\x01"); });
  ASSERT_FALSE(other.has_value());
  EXPECT_EQ(other.error().kind, ErrorKind::kInternal);
  EXPECT_EQ(other.error().message, "internal error: two lines\\x01");
}

TEST(Workers, ErrorsKeepTheirKind) {
  for (const ErrorKind kind : {ErrorKind::kUsage, ErrorKind::kEnvironment, ErrorKind::kData}) {
    const auto next = FirstOf([&](Channel&) -> Expected<void> {
      return tl::unexpected(Error{kind, "a sentence"});
    });
    ASSERT_FALSE(next.has_value());
    EXPECT_EQ(next.error().kind, kind);
    EXPECT_EQ(next.error().message, "a sentence");
  }
}

// What a child that went mad sends is no reason to go with it.
TEST(Workers, AnErrorThatCannotBeReadIsOne) {
  for (const char* line : {"error ", "error x", "error 9 sentence", "error \xff"}) {
    const auto next = FirstOf([&](Channel& channel) -> Expected<void> {
      channel.Send(line);
      return {};
    });
    ASSERT_FALSE(next.has_value()) << line;
    EXPECT_EQ(next.error().kind, ErrorKind::kInternal) << line;
  }
}

}  // namespace
}  // namespace tsdfpp
