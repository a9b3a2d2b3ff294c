#pragma once
/// @file seqlock.hpp
/// The copying protocol of a topic. Private to rtbus.
