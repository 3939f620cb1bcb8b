#include "impulse_sums.hpp"

namespace fork1s {
namespace {

void AddTimes(double weight, const std::vector<double>& more, std::vector<double>& sums) {
  sums.resize(more.size(), 0.0);
  for (std::size_t i = 0; i < more.size(); ++i) sums[i] += weight * more[i];
}

void Set(const ImpulseSums::Contact& sum, ContactRecord& contact) {
  contact.moment = contact.point.frame * sum.wrench_W.head<3>();
  contact.impulse = contact.point.frame * sum.wrench_W.tail<3>();
  contact.pull = contact.point.frame * sum.pull_W;
  contact.normal_sum = sum.normal;
  contact.tangential_sum = sum.tangential;
}

}  // namespace

void ImpulseSums::Reserve(std::size_t count) {
  contacts.reserve(count);
  ended.reserve(count);
}

void ImpulseSums::Clear(std::size_t mechanisms, std::size_t switched_closures) {
  closures.assign(switched_closures, Vector6::Zero());
  contacts.clear();
  ended.clear();
  rows.resize(mechanisms);
  for (WorldState::Rows& of_mechanism : rows) {
    of_mechanism.limit_impulses.clear();
    of_mechanism.friction_impulses.clear();
  }
}

void ImpulseSums::AddRows(double weight, std::size_t mechanism, const std::vector<double>& limit_impulses,
                          const std::vector<double>& friction_impulses) {
  AddTimes(weight, limit_impulses, rows[mechanism].limit_impulses);
  AddTimes(weight, friction_impulses, rows[mechanism].friction_impulses);
}

void ImpulseSums::StoreContacts(std::vector<ContactRecord>& of_step) const {
  for (std::size_t i = 0; i < of_step.size(); ++i) Set(contacts[i], of_step[i]);
  of_step.insert(of_step.end(), ended.begin(), ended.end());
}

void ContactSummation::Reserve(std::size_t contacts) {
  next_.reserve(contacts);
  goes_on_.reserve(contacts);
}

void ContactSummation::Add(double weight, const std::vector<ContactRecord>& contacts,
                           const std::vector<int>& match, const std::vector<ContactRecord>& previous,
                           ImpulseSums& sums) {
  next_.resize(contacts.size());
  goes_on_.assign(sums.contacts.size(), 0);
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    const Matrix3 frame_W = contacts[i].point.frame.transpose();
    ImpulseSums::Contact& sum = next_[i];
    sum.wrench_W.head<3>() = weight * (frame_W * contacts[i].moment);
    sum.wrench_W.tail<3>() = weight * (frame_W * contacts[i].impulse);
    sum.pull_W = weight * (frame_W * contacts[i].pull);
    sum.normal = weight * contacts[i].impulse(0);
    sum.tangential = weight * contacts[i].impulse.tail<2>().norm();
    if (match[i] < 0 || sums.contacts.empty()) continue;
    const auto k = static_cast<std::size_t>(match[i]);
    const ImpulseSums::Contact& before = sums.contacts[k];
    sum.wrench_W += before.wrench_W;
    sum.pull_W += before.pull_W;
    sum.normal += before.normal;
    sum.tangential += before.tangential;
    goes_on_[k] = 1;
  }
  for (std::size_t i = 0; i < goes_on_.size(); ++i) {
    if (goes_on_[i] || (sums.contacts[i].wrench_W.isZero(0) && sums.contacts[i].pull_W.isZero(0))) continue;
    sums.ended.push_back(previous[i]);
    Set(sums.contacts[i], sums.ended.back());
  }
  sums.contacts.swap(next_);
}

}  // namespace fork1s
