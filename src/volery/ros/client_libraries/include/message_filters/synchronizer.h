// message_filters::Synchronizer and TimeSynchronizer, with the policies ExactTime and ApproximateTime.
#pragma once
#include <array>
#include <cmath>
#include <deque>
#include <limits>
#include <map>
#include <tuple>
#include <utility>

#include "message_filters/simple_filter.h"

namespace message_filters {

struct NullType {};

namespace detail {

template <class... Messages>
struct List {};
template <class Kept, class... Left>
struct WithoutNull;
template <class... Kept>
struct WithoutNull<List<Kept...>> {
    using type = List<Kept...>;
};
template <class... Kept, class First, class... Left>
struct WithoutNull<List<Kept...>, First, Left...>
    : std::conditional_t<std::is_same_v<First, NullType>, WithoutNull<List<Kept...>>,
                         WithoutNull<List<Kept..., First>, Left...>> {};

// The callbacks of a synchronizer, and the set of messages that they get.
template <class... Messages>
class Output {
public:
    static constexpr std::size_t COUNT = sizeof...(Messages);
    using Set = std::tuple<library::Event<Messages>...>;

    template <class Function>
    Connection registerCallback(const Function& callback) {
        return calls_.add([callback](const library::Event<Messages>&... events) mutable {
            callback(events.getConstMessage()...);
        });
    }
    template <class... Parameters>
    Connection registerCallback(void (*callback)(Parameters...)) {
        return add<Parameters...>(callback);
    }
    template <class... Parameters>
    Connection registerCallback(const library::Function<void(Parameters...)>& callback) {
        return add<Parameters...>(callback);
    }
    template <class Class, class Base, class... Parameters>
    Connection registerCallback(void (Base::*callback)(Parameters...), Class* object) {
        return add<Parameters...>([=](Parameters... messages) { (object->*callback)(messages...); });
    }

protected:
    void signal(const Set& set) { std::apply(calls_, set); }

private:
    template <class... Parameters, class Function>
    Connection add(Function callback) {
        static_assert(sizeof...(Parameters) == COUNT, "a callback of a synchronizer has one parameter a message");
        return calls_.add([callback](const library::Event<Messages>&... events) {
            callback(argument<Parameters, Messages>(events)...);
        });
    }
    Calls<library::Event<Messages>...> calls_;
};

// Sets of messages with the same stamp.
template <class... Messages>
class Exact : public Output<Messages...> {
public:
    using typename Output<Messages...>::Set;
    explicit Exact(std::uint32_t queue_size) : size_(queue_size) {}

    template <std::size_t input>
    void add(const std::tuple_element_t<input, Set>& event) {
        auto const at = library::stamp<std::tuple_element_t<input, std::tuple<Messages...>>>(event);
        auto& set = sets_[at];
        std::get<input>(set.events) = event;
        set.there[input] = true;
        if (std::all_of(set.there.begin(), set.there.end(), [](bool there) { return there; })) {
            auto const full = set.events;
            sets_.erase(at);
            this->signal(full);
            while (!sets_.empty() && sets_.begin()->first <= at) drop();
        }
        while (size_ > 0 && sets_.size() > size_) drop();
    }
    // Of sets that stayed incomplete; the messages that never came are null.
    template <class Function>
    Connection registerDropCallback(const Function& callback) {
        return drops_.add([callback](const library::Event<Messages>&... events) {
            callback(events.getConstMessage()...);
        });
    }
    template <class Member, class Class>
    Connection registerDropCallback(const Member& callback, Class* object) {
        return registerDropCallback([=](const auto&... messages) { (object->*callback)(messages...); });
    }

private:
    struct Partial {
        Set events;
        std::array<bool, sizeof...(Messages)> there{};
    };
    void drop() {
        auto const events = sets_.begin()->second.events;
        sets_.erase(sets_.begin());
        std::apply(drops_, events);
    }
    std::size_t size_;
    std::map<std::int64_t, Partial> sets_;
    Calls<library::Event<Messages>...> drops_;
};

// Sets of messages with stamps that are close to each other, each message in one set at most, by the algorithm of
// http://wiki.ros.org/message_filters/ApproximateTime: a set is complete when no later message can make it narrower.
template <class... Messages>
class Approximate : public Output<Messages...> {
public:
    using typename Output<Messages...>::Set;
    using Output<Messages...>::COUNT;
    explicit Approximate(std::uint32_t queue_size) : size_(queue_size) {
        bounds_.fill(0);
    }

    template <std::size_t input>
    void add(const std::tuple_element_t<input, Set>& event) {
        auto& queue = std::get<input>(waiting_);
        queue.push_back(event);
        if (queue.size() == 1 && all_waiting()) process();
        if (queue.size() + std::get<input>(past_).size() <= size_) return;
        each([&](auto index) { recover<index>(std::get<index>(past_).size()); });
        std::get<input>(waiting_).pop_front();
        dropped_[input] = true;
        if (pivot_ == NONE) return;
        pivot_ = NONE;
        process();
    }
    void setAgePenalty(double penalty) { age_penalty_ = penalty; }
    void setInterMessageLowerBound(int input, library::Duration bound) {
        bounds_.at(static_cast<std::size_t>(input)) = library::nanoseconds(bound);
    }
    void setInterMessageLowerBound(library::Duration bound) { bounds_.fill(library::nanoseconds(bound)); }
    void setMaxIntervalDuration(library::Duration longest) { longest_ = library::nanoseconds(longest); }

private:
    static constexpr std::size_t NONE = COUNT;
    using Stamps = std::array<std::int64_t, COUNT>;

    // Call with each index as a constant.
    template <class Function>
    static void each(Function function) {
        each(function, std::index_sequence_for<Messages...>());
    }
    template <class Function, std::size_t... index>
    static void each(Function& function, std::index_sequence<index...>) {
        (function(std::integral_constant<std::size_t, index>()), ...);
    }
    bool all_waiting() const {
        return std::apply([](const auto&... queue) { return (!queue.empty() && ...); }, waiting_);
    }
    // Stamps of the next messages; of an input that has none the earliest that its next one may have.
    Stamps next() const {
        Stamps stamps;
        each([&](auto index) {
            using Message = std::tuple_element_t<index, std::tuple<Messages...>>;
            const auto& queue = std::get<index>(waiting_);
            stamps[index] = queue.empty() ? std::max(library::stamp<Message>(std::get<index>(past_).back()) + bounds_[index], pivot_time_)
                                          : library::stamp<Message>(queue.front());
        });
        return stamps;
    }
    static std::size_t first_of(const Stamps& stamps) {
        return static_cast<std::size_t>(std::min_element(stamps.begin(), stamps.end()) - stamps.begin());
    }
    static std::size_t last_of(const Stamps& stamps) {
        auto const reversed = std::max_element(stamps.rbegin(), stamps.rend());
        return static_cast<std::size_t>(stamps.rend() - reversed) - 1;
    }
    // Whether a set that ends at *end* can be no better than the candidate, measured from *start*.
    bool no_better(std::int64_t end, std::int64_t start) const {
        return std::llround(static_cast<double>(end - candidate_end_) * (1 + age_penalty_)) >= start - candidate_start_;
    }
    void advance(std::size_t input, bool keep = true) {
        each([&](auto index) {
            if (index != input) return;
            auto& queue = std::get<index>(waiting_);
            if (keep) std::get<index>(past_).push_back(queue.front());
            queue.pop_front();
        });
    }
    template <std::size_t input>
    void recover(std::size_t count) {
        auto& past = std::get<input>(past_);
        for (; count > 0; --count) {
            std::get<input>(waiting_).push_front(past.back());
            past.pop_back();
        }
    }
    void become_candidate(std::int64_t start, std::int64_t end) {
        each([&](auto index) {
            std::get<index>(candidate_) = std::get<index>(waiting_).front();
            std::get<index>(past_).clear();
        });
        candidate_start_ = start;
        candidate_end_ = end;
    }
    void publish() {
        auto const set = candidate_;
        pivot_ = NONE;
        each([&](auto index) {
            recover<index>(std::get<index>(past_).size());
            std::get<index>(waiting_).pop_front();
        });
        this->signal(set);
    }
    void process() {
        while (all_waiting()) {
            auto const stamps = next();
            auto const first = first_of(stamps), last = last_of(stamps);
            auto const start = stamps[first], end = stamps[last];
            for (std::size_t input = 0; input < COUNT; ++input)
                if (input != last) dropped_[input] = false;
            if (pivot_ == NONE) {
                if (end - start > longest_ || dropped_[last]) {
                    advance(first, false);
                    continue;
                }
                become_candidate(start, end);
                pivot_ = last;
                pivot_time_ = end;
            } else if (!no_better(end, start)) {
                become_candidate(start, end);
            }
            advance(first);
            if (first == pivot_ || no_better(end, pivot_time_))
                publish();
            else if (!all_waiting())
                look_ahead();
        }
    }
    // Search with the earliest stamps that may still come for proof that the candidate is the best.
    void look_ahead() {
        std::array<std::size_t, COUNT> moved{};
        while (true) {
            auto const stamps = next();
            auto const first = first_of(stamps);
            auto const end = stamps[last_of(stamps)];
            if (no_better(end, pivot_time_)) return publish();
            if (!no_better(end, stamps[first])) break;
            advance(first);
            ++moved[first];
        }
        each([&](auto index) { recover<index>(moved[index]); });
    }

    std::size_t size_;
    std::tuple<std::deque<library::Event<Messages>>...> waiting_;
    std::tuple<std::vector<library::Event<Messages>>...> past_;
    Set candidate_;
    std::int64_t candidate_start_ = 0, candidate_end_ = 0, pivot_time_ = 0;  // ns
    std::size_t pivot_ = NONE;  // the input whose message ended the first candidate
    std::array<bool, COUNT> dropped_{};
    std::array<std::int64_t, COUNT> bounds_;
    std::int64_t longest_ = std::numeric_limits<std::int64_t>::max();
    double age_penalty_ = 0.1;
};

template <template <class...> class Policy, class Messages>
struct OfList;
template <template <class...> class Policy, class... Messages>
struct OfList<Policy, List<Messages...>> {
    using type = Policy<Messages...>;
};
template <template <class...> class Policy, class... Messages>
using Of = typename OfList<Policy, typename WithoutNull<List<>, Messages...>::type>::type;

}  // namespace detail

namespace sync_policies {

template <class... Messages>
class ExactTime : public detail::Of<detail::Exact, Messages...> {
    using Base = detail::Of<detail::Exact, Messages...>;

public:
    using Base::Base;
};

template <class... Messages>
class ApproximateTime : public detail::Of<detail::Approximate, Messages...> {
    using Base = detail::Of<detail::Approximate, Messages...>;

public:
    using Base::Base;
};

}  // namespace sync_policies

template <class Policy>
class Synchronizer : public Policy {
public:
    Synchronizer() : Policy(10) {}
    explicit Synchronizer(const Policy& policy) : Policy(policy) {}
    template <class... Filters, class = std::enable_if_t<(sizeof...(Filters) > 1)>>
    explicit Synchronizer(Filters&... filters) : Policy(10) {
        connectInput(filters...);
    }
    template <class First, class... Filters>
    Synchronizer(const Policy& policy, First& first, Filters&... filters) : Policy(policy) {
        connectInput(first, filters...);
    }
    Synchronizer(const Synchronizer&) = delete;
    Synchronizer& operator=(const Synchronizer&) = delete;
    ~Synchronizer() { disconnect(); }

    template <class... Filters>
    void connectInput(Filters&... filters) {
        static_assert(sizeof...(Filters) == Policy::COUNT, "a synchronizer has one input a message");
        disconnect();
        connect(std::index_sequence_for<Filters...>(), filters...);
    }
    template <int input, class Message>
    void add(const library::Pointer<Message>& message) {
        Policy::template add<input>({message, library::now()});
    }
    using Policy::add;
    Policy* getPolicy() { return this; }
    void setName(const std::string& name) { name_ = name; }
    const std::string& getName() const { return name_; }

private:
    template <std::size_t... input, class... Filters>
    void connect(std::index_sequence<input...>, Filters&... filters) {
        (inputs_.push_back(filters.registerCallback(library::Function<void(
             const std::tuple_element_t<input, typename Policy::Set>&)>(
             [this](const auto& event) { Policy::template add<input>(event); }))),
         ...);
    }
    void disconnect() {
        for (auto& one : inputs_) one.disconnect();
        inputs_.clear();
    }
    std::vector<Connection> inputs_;
    std::string name_;
};

template <class... Messages>
class TimeSynchronizer : public Synchronizer<sync_policies::ExactTime<Messages...>> {
public:
    using Policy = sync_policies::ExactTime<Messages...>;
    explicit TimeSynchronizer(std::uint32_t queue_size) : Synchronizer<Policy>(Policy(queue_size)) {}
    // The filters, then the size of the queue.
    template <class First, class Second, class... Others>
    TimeSynchronizer(First& first, Second& second, Others&&... others)
        : TimeSynchronizer(std::get<sizeof...(Others) - 1>(std::forward_as_tuple(others...))) {
        connect(std::make_index_sequence<sizeof...(Others) + 1>(), std::forward_as_tuple(first, second, others...));
    }

private:
    template <std::size_t... input, class Filters>
    void connect(std::index_sequence<input...>, Filters filters) {
        this->connectInput(std::get<input>(filters)...);
    }
};

}  // namespace message_filters
