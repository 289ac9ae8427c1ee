(* Rules: what evidence shows of polynomials with whole coefficients. Their proofs stand here, so none is to be believed. *)
From Coq Require Import Reals ZArith List Lra Lia Bool.
Import ListNotations.
Open Scope R_scope.

(* Whole numbers as they are written: Rocq reads digits that stay digits far sooner. *)
Inductive number := Digits (n : Number.int).
Definition digits (n : number) := match n with Digits n => n end.
Declare Scope number_scope.
Bind Scope number_scope with number.
Number Notation number Digits digits : number_scope.
Definition whole n := Z.of_num_int (digits n).
(* As real numbers; sealed, so that unequal ones are found to be so without work. *)
Definition sealed : { f : number -> R | forall n, f n = IZR (whole n) }.
Proof. exists (fun n => IZR (whole n)). trivial. Qed.
Definition num := proj1_sig sealed.
Lemma num_is n : num n = IZR (whole n).
Proof. exact (proj2_sig sealed n). Qed.
Inductive row := last | next (n : number) (r : row).
Notation "(| a , .. , b |)" := (next a .. (next b last) ..).
Fixpoint entries r := match r with last => nil | next n r => whole n :: entries r end.

(* A polynomial as it is written: terms, each of a coefficient and of the places of its factors among the variables x. *)
Inductive mono := e | v (i : nat) (m : mono).
Inductive poly := o | t (c : number) (m : mono) (p : poly).
Fixpoint product x (c : R) m := match m with e => c | v i m => product x (c * nth i x 0) m end.
Fixpoint onward x s p := match p with o => s | t c m p => onward x (s + product x (num c) m) p end.
Definition value x p := match p with o => 0 | t c m p => onward x (product x (num c) m) p end.

(* The same for work. A monomial is a number: from its lowest bit on each 1 is a factor, each 0 goes on to the next variable. *)
Definition terms := list (Z * positive).
Fixpoint power x k := match k with xH => 1 | xI k => hd 0 x * power x k | xO k => power (tl x) k end.
Fixpoint at_ x (p : terms) := match p with nil => 0 | (c, k) :: p => IZR c * power x k + at_ x p end.
Fixpoint place i := match i with O => xI xH | S i => xO (place i) end.
Fixpoint both a : positive -> positive := match a with
  | xH => fun b => b
  | xI a => fun b => xI (both a b)
  | xO a => fix beside b := match b with xH => xO a | xI b => xI (beside b) | xO b => xO (both a b) end end.
Fixpoint key m := match m with e => xH | v i m => both (place i) (key m) end.
Fixpoint spread p : terms := match p with o => nil | t c m p => (whole c, key m) :: spread p end.
Lemma both_is a : forall x b, power x (both a b) = power x a * power x b.
Proof.
  induction a as [a IH | a IH |]; intros x b; simpl; [rewrite IH; ring | | ring].
  induction b as [b IHb | b _ |]; simpl; [rewrite IHb; ring | apply IH | ring].
Qed.
Lemma place_is i : forall x, power x (place i) = nth i x 0.
Proof. induction i as [| i IH]; intros [| y x]; simpl; try ring; rewrite IH; destruct i; trivial. Qed.
Lemma product_is x m : forall c, product x c m = c * power x (key m).
Proof. induction m as [| i m IH]; intros; simpl; [ring |]. rewrite IH, both_is, place_is. ring. Qed.
Lemma value_is x p : value x p = at_ x (spread p).
Proof.
  assert (H : forall p s, onward x s p = s + at_ x (spread p)).
  { induction p0 as [| c m p0 IH]; intros; simpl; [ring |]. rewrite IH, product_is, num_is. ring. }
  destruct p as [| c m p]; simpl; trivial. rewrite H, product_is, num_is. ring.
Qed.

(* Sums and products; equal terms meet in a tree. *)
Definition times_term c k (p : terms) : terms := map (fun t => ((c * fst t)%Z, both k (snd t))) p.
Fixpoint mul (p q : terms) : terms := match p with nil => nil | (c, k) :: p => times_term c k q ++ mul p q end.
Definition scale c (p : terms) : terms := map (fun t => ((c * fst t)%Z, snd t)) p.
Fixpoint dot (p q : list terms) := match p, q with a :: p, b :: q => mul a b ++ dot p q | _, _ => nil end.
Inductive tree := Leaf | Node (l : tree) (c : Z) (r : tree).
Fixpoint put k c s := match k, s with
  | xH, Leaf => Node Leaf c Leaf | xH, Node l d r => Node l (c + d) r
  | xO k, Leaf => Node (put k c Leaf) 0 Leaf | xO k, Node l d r => Node (put k c l) d r
  | xI k, Leaf => Node Leaf 0 (put k c Leaf) | xI k, Node l d r => Node l d (put k c r) end.
Definition gathered (p : terms) := fold_right (fun t s => put (snd t) (fst t) s) Leaf p.
Fixpoint vanish s := match s with Leaf => true | Node l c r => (Z.eqb c 0 && vanish l && vanish r)%bool end.
Fixpoint listed (f : positive -> positive) s rest : terms := match s with
  | Leaf => rest
  | Node l c r =>
      let more := listed (fun k => f (xO k)) l (listed (fun k => f (xI k)) r rest) in
      if Z.eqb c 0 then more else (c, f xH) :: more end.
Definition tidy p := listed (fun k => k) (gathered p) nil.
Definition zero p := vanish (gathered p).

Lemma app_is x p q : at_ x (p ++ q) = at_ x p + at_ x q.
Proof. induction p as [| [c m] p IH]; simpl; [ring |]. rewrite IH. ring. Qed.
Lemma times_term_is x c k p : at_ x (times_term c k p) = IZR c * power x k * at_ x p.
Proof. unfold times_term. induction p as [| [d n] p IH]; simpl; [ring |]. rewrite both_is, mult_IZR, IH. ring. Qed.
Lemma mul_is x p q : at_ x (mul p q) = at_ x p * at_ x q.
Proof. induction p as [| [c m] p IH]; simpl; [ring |]. rewrite app_is, times_term_is, IH. ring. Qed.
Lemma scale_is x c p : at_ x (scale c p) = IZR c * at_ x p.
Proof. unfold scale. induction p as [| [d n] p IH]; simpl; [ring |]. rewrite mult_IZR, IH. ring. Qed.
Fixpoint held (f : positive -> R) s := match s with
  | Leaf => 0 | Node l c r => held (fun k => f (xO k)) l + IZR c * f xH + held (fun k => f (xI k)) r end.
Lemma put_is k c : forall s f, held f (put k c s) = IZR c * f k + held f s.
Proof. induction k as [k IH | k IH |]; intros [| l d r] f; simpl; rewrite ?IH, ?plus_IZR; simpl; ring. Qed.
Lemma gathered_is x p : held (power x) (gathered p) = at_ x p.
Proof. unfold gathered. induction p as [| [c k] p IH]; simpl; trivial. rewrite put_is, IH. ring. Qed.
Lemma listed_is x s : forall f rest, at_ x (listed f s rest) = held (fun k => power x (f k)) s + at_ x rest.
Proof.
  induction s as [| l IHl c r IHr]; intros f rest; simpl; [ring |].
  destruct (Z.eqb_spec c 0) as [-> | _]; simpl; rewrite IHl, IHr; ring.
Qed.
Lemma tidy_is x p : at_ x (tidy p) = at_ x p.
Proof.
  unfold tidy. rewrite listed_is. transitivity (held (power x) (gathered p) + 0); [trivial | rewrite gathered_is; ring].
Qed.
Lemma zero_is x p : zero p = true -> at_ x p = 0.
Proof.
  assert (H : forall s f, vanish s = true -> held f s = 0).
  { induction s as [| l IHl c r IHr]; simpl; trivial. intros f H. apply andb_prop in H. destruct H as [H K].
    apply andb_prop in H. destruct H as [H J]. apply Z.eqb_eq in H. subst. rewrite IHl, IHr; trivial. ring. }
  intro. rewrite <- (gathered_is x p). auto.
Qed.
(* A symmetric matrix, as its rows from the diagonal on, is nowhere negative: elimination without fractions. *)
Fixpoint along (g : list Z) (z : list R) := match g, z with a :: g, r :: z => IZR a * r + along g z | _, _ => 0 end.
Fixpoint form (G : list (list Z)) (z : list R) := match G, z with
  | (a :: g) :: G, r :: z => IZR a * r * r + 2 * r * along g z + form G z | _, _ => 0 end.
Fixpoint less_row (b c a : Z) r g := match r, g with
  | x :: r, y :: g => ((a * x - b * y) / c)%Z :: less_row b c a r g | _, _ => nil end.
Fixpoint rest (c a : Z) g (G : list (list Z)) := match g, G with
  | b :: h, r :: G => less_row b c a r g :: rest c a h G | _, _ => nil end.
Fixpoint exact_row (b c a : Z) s r g := match s, r, g with
  | w :: s, x :: r, y :: g => (Z.eqb (c * w) (a * x - b * y) && exact_row b c a s r g)%bool
  | nil, nil, nil => true | _, _, _ => false end.
Fixpoint exact (c a : Z) g T G := match g, T, G with
  | b :: g, (w :: s) :: T, (x :: r) :: G =>
      (Z.eqb (c * w) (a * x - b * b) && exact_row b c a s r g && exact c a g T G)%bool
  | nil, nil, nil => true | _, _, _ => false end.
Fixpoint nowhere_negative n (c : Z) (G : list (list Z)) := match n, G with
  | _, nil => true
  | S n, (a :: g) :: G =>
      if Z.eqb a 0 then (forallb (fun y => Z.eqb y 0) g && nowhere_negative n c G)%bool
      else let T := rest c a g G in (Z.ltb 0 a && exact c a g T G && nowhere_negative n a T)%bool
  | _, _ => false end.

Lemma exact_row_is b c a s : forall r g z, exact_row b c a s r g = true ->
  IZR c * along s z = IZR a * along r z - IZR b * along g z.
Proof.
  induction s as [| w s IH]; destruct r, g; simpl; try discriminate; intros t H; [ring |].
  apply andb_prop in H. destruct H as [H K]. apply Z.eqb_eq in H. destruct t as [| u t]; [ring |].
  apply (f_equal IZR) in H. rewrite minus_IZR, !mult_IZR in H. specialize (IH _ _ t K).
  replace (IZR c * (IZR w * u + along s t)) with (IZR c * IZR w * u + IZR c * along s t) by ring. rewrite H, IH. ring.
Qed.
Lemma exact_is c a : forall g T G z, exact c a g T G = true ->
  IZR c * form T z = IZR a * form G z - along g z * along g z.
Proof.
  induction g as [| b g IH]; destruct T as [| [| w s] T], G as [| [| x r] G]; simpl; try discriminate; intros z H; [ring |].
  apply andb_prop in H. destruct H as [H L]. apply andb_prop in H. destruct H as [H K]. apply Z.eqb_eq in H.
  destruct z as [| u z]; [ring |]. apply (f_equal IZR) in H. rewrite minus_IZR, !mult_IZR in H.
  specialize (IH _ _ z L). apply exact_row_is with (z := z) in K.
  replace (IZR c * (IZR w * u * u + 2 * u * along s z + form T z))
    with (IZR c * IZR w * u * u + 2 * u * (IZR c * along s z) + IZR c * form T z) by ring.
  rewrite H, K, IH. ring.
Qed.
Lemma nothing g : forall z, forallb (fun y => Z.eqb y 0) g = true -> along g z = 0.
Proof.
  induction g as [| a g IH]; destruct z as [| u z]; simpl; trivial. intro H. apply andb_prop in H. destruct H as [H K].
  apply Z.eqb_eq in H. subst. rewrite IH; trivial. ring.
Qed.
Lemma nowhere_negative_is n : forall c G z, nowhere_negative n c G = true -> 0 < IZR c -> 0 <= form G z.
Proof.
  induction n as [| n IH]; intros c [| [| a g] G] z; simpl; try discriminate; intros H C; try lra.
  destruct z as [| u z]; try lra. destruct (Z.eqb_spec a 0) as [-> | E].
  - apply andb_prop in H. destruct H as [H K]. rewrite (nothing g z H). specialize (IH c G z K C). nra.
  - apply andb_prop in H. destruct H as [H L]. apply andb_prop in H. destruct H as [H K].
    apply Z.ltb_lt, IZR_lt in H. apply exact_is with (z := z) in K. specialize (IH a _ z L H).
    apply Rmult_le_reg_l with (IZR a); trivial.
    pose proof (Rle_0_sqr (IZR a * u + along g z)). unfold Rsqr in *.
    pose proof (Rmult_le_pos _ _ (Rlt_le _ _ C) IH). nra.
Qed.

(* Sooner: with each row goes a square m (u.z)^2 of short numbers u, after which the diagonal outweighs what is left of the row. *)
Definition row_less m (r s : list Z) := map (fun t => (fst t - m * snd t)%Z) (combine r s).
Fixpoint rows_less m (G : list (list Z)) u := match G, u with
  | r :: G, a :: w => row_less (m * a) r u :: rows_less m G w | _, _ => nil end.
Fixpoint alike (G : list (list Z)) (u : list Z) := match G, u with
  | r :: G, _ :: w => (Nat.eqb (length r) (length u) && alike G w)%bool | nil, nil => true | _, _ => false end.
Fixpoint outweighs k m b U (G : list (list Z)) := match U with
  | nil => match G with nil => true | _ => false end
  | u :: U => match rows_less m G u with
      | (a :: g) :: R => (alike G u && Z.leb (b * (k + Z.of_nat (length g))) a &&
                          forallb (fun y => Z.leb (Z.abs y) b) g && outweighs (k + 1) m b U R)%bool
      | _ => false end end%Z.
Definition semidefinite s r U (G : list (list Z)) := match U with
  | nil => nowhere_negative (length G) 1 G
  | _ => outweighs 0 (2 ^ whole s) (2 ^ whole r) (map entries U) G end.

Definition squares z := fold_right (fun u s => u * u + s) 0 z.
Lemma squares_is z : 0 <= squares z.
Proof. induction z; simpl; [lra | nra]. Qed.
Lemma row_less_is m r : forall s z, length r = length s -> along (row_less m r s) z = along r z - IZR m * along s z.
Proof.
  induction r as [| a r IH]; destruct s as [| b s]; simpl; try discriminate; intros z E; [destruct z; ring |].
  destruct z as [| u z]; [ring |]. injection E; intro. unfold row_less in IH. rewrite IH; trivial.
  rewrite minus_IZR, mult_IZR. ring.
Qed.
Lemma rows_less_is m G : forall u z, alike G u = true ->
  form G z = IZR m * (along u z * along u z) + form (rows_less m G u) z.
Proof.
  induction G as [| r G IH]; intros [| a w] z; simpl; try discriminate; intro E; [destruct z; ring |].
  apply andb_prop in E. destruct E as [E K]. destruct r as [| c r]; simpl in E; try discriminate.
  apply Nat.eqb_eq in E. destruct z as [| y z]; simpl; [ring |]. rewrite (IH w z K).
  pose proof (row_less_is (m * a) r w z E) as L. unfold row_less in L. rewrite L. rewrite minus_IZR, !mult_IZR. ring.
Qed.
Lemma rows_less_long m G : forall u, alike G u = true -> length (rows_less m G u) = length G.
Proof.
  induction G as [| r G IH]; intros [| a w]; simpl; try discriminate; trivial.
  intro E. apply andb_prop in E. f_equal. apply IH, E.
Qed.
Lemma along_bounded m g : forall u z, 0 <= IZR m -> forallb (fun y => Z.leb (Z.abs y) m) g = true ->
  - (IZR m * (INR (length g) * u * u + squares z)) <= 2 * u * along g z.
Proof.
  induction g as [| a g IH]; intros u z M H.
  - simpl. pose proof (squares_is z). nra.
  - simpl forallb in H. apply andb_prop in H. destruct H as [H K]. apply Z.leb_le, IZR_le in H. rewrite abs_IZR in H.
    replace (INR (length (a :: g))) with (INR (length g) + 1) by (simpl length; rewrite S_INR; ring).
    pose proof (pos_INR (length g)). destruct z as [| v z].
    + simpl. pose proof (Rle_0_sqr u). unfold Rsqr in *. assert (0 <= INR (length g) * (u * u)) by nra. nra.
    + specialize (IH u z M K). simpl. assert (- (IZR m * (u * u + v * v)) <= 2 * u * (IZR a * v)); [| nra].
      pose proof (Rle_abs (IZR a)). pose proof (Rle_abs (- IZR a)). rewrite Rabs_Ropp in *.
      pose proof (Rle_0_sqr (u + v)). pose proof (Rle_0_sqr (u - v)). unfold Rsqr in *.
      assert (0 <= (IZR m - IZR a) * ((u - v) * (u - v))) by (apply Rmult_le_pos; lra).
      assert (0 <= (IZR m + IZR a) * ((u + v) * (u + v))) by (apply Rmult_le_pos; lra). lra.
Qed.
Lemma outweighs_is m b U : forall k G z, 0 <= IZR m -> 0 <= IZR b -> outweighs k m b U G = true ->
  (length z <= length G)%nat -> IZR k * IZR b * squares z <= form G z.
Proof.
  induction U as [| u U IH]; simpl; intros k G z M B H L.
  - destruct G; try discriminate. destruct z; simpl in *; [lra | lia].
  - destruct (rows_less m G u) as [| [| a g] R] eqn:E; try discriminate.
    apply andb_prop in H. destruct H as [H K]. apply andb_prop in H. destruct H as [H J]. apply andb_prop in H.
    destruct H as [A H]. pose proof (rows_less_is m G u z A) as F. pose proof (rows_less_long m G u A) as S.
    rewrite E in F, S. rewrite F. pose proof (Rle_0_sqr (along u z)) as Q. unfold Rsqr in Q.
    pose proof (Rmult_le_pos _ _ M Q). destruct z as [| y z]; [simpl in *; lra |].
    apply Z.leb_le, IZR_le in H. rewrite mult_IZR, plus_IZR, <- INR_IZR_INZ in H.
    pose proof (along_bounded b g y z B J). simpl in S, L. assert (L' : (length z <= length R)%nat) by lia.
    specialize (IH (k + 1)%Z R z M B K L'). rewrite plus_IZR in IH. simpl.
    pose proof (Rle_0_sqr y). unfold Rsqr in *. nra.
Qed.
Lemma power_of_two n : 0 <= IZR (2 ^ n).
Proof. apply IZR_le. apply Z.pow_nonneg. lia. Qed.
Lemma semidefinite_is s r U G z : semidefinite s r U G = true -> length z = length G -> 0 <= form G z.
Proof.
  unfold semidefinite. destruct U as [| u U]; intros H L.
  - apply nowhere_negative_is with (1 := H). lra.
  - apply outweighs_is with (z := z) in H; try apply power_of_two; [lra | rewrite L; trivial].
Qed.

(* What is said of a matrix alone. *)
Definition positive_definite (G : list row) :=
  forall z, length z = length G -> 0 < squares z -> 0 < form (map entries G) z.
Fixpoint lowered (G : list (list Z)) := match G with (a :: g) :: G => ((a - 1)%Z :: g) :: lowered G | G => G end.
Definition definite s r U G :=
  (forallb (fun g => match g with nil => false | _ => true end) G && semidefinite s r U (lowered G))%bool.
Theorem positive s r U G : definite s r U (map entries G) = true -> positive_definite G.
Proof.
  unfold definite, positive_definite. intros H z L S. apply andb_prop in H. destruct H as [H K].
  rewrite <- (map_length entries G) in L. revert H K L. generalize (map entries G). intros F H K L.
  assert (P : forall F z, forallb (fun g : list Z => match g with nil => false | _ => true end) F = true ->
    length z = length F -> form (lowered F) z = form F z - squares z /\ length (lowered F) = length F).
  { clear. induction F as [| [| a g] F IH]; intros [| y z]; simpl; try discriminate; intros H L; [split; [ring | trivial] |].
    injection L; intro L'. destruct (IH z H L') as [I J]. rewrite I, J, minus_IZR. split; [ring | trivial]. }
  destruct (P F z H L) as [I J]. rewrite <- J in L. pose proof (semidefinite_is s r U _ z K L). lra.
Qed.

(* z'Gz as a polynomial. *)
Fixpoint along_poly g z : terms := match g, z with a :: g, p :: z => scale a p ++ along_poly g z | _, _ => nil end.
Fixpoint form_poly G z : terms := match G, z with
  | (a :: g) :: G, p :: z => mul p (scale a p ++ scale 2 (along_poly g z)) ++ form_poly G z | _, _ => nil end.
Lemma along_poly_is x g : forall z, at_ x (along_poly g z) = along g (map (at_ x) z).
Proof. induction g; destruct z; simpl; trivial. rewrite app_is, scale_is, IHg. trivial. Qed.
Lemma form_poly_is x G : forall z, at_ x (form_poly G z) = form G (map (at_ x) z).
Proof.
  induction G as [| [| a g] G IH]; destruct z; simpl; trivial.
  rewrite app_is, mul_is, app_is, !scale_is, along_poly_is, IH. ring.
Qed.

(* k (p - low) = cofactors . zeros + the sum of parts: products of what is not negative, each times z'Gz. *)
Record part := Part { of : mono; forms : list poly; gram : list row; size : number; error : number; taken : list row }.
Record shown := Shown {
  k : number; p : poly; low : poly; zeros : list poly; known : list poly; cofactors : list poly; parts : list part }.
Fixpoint times_known (known : list poly) m (f : terms) := match m with
  | e => f | v i m => times_known known m (tidy (mul (spread (nth i known o)) f)) end.
Definition part_poly known t := times_known known (of t) (tidy (form_poly (map entries (gram t)) (map spread (forms t)))).
Definition nonnegative t :=
  (Nat.eqb (length (forms t)) (length (gram t)) && semidefinite (size t) (error t) (taken t) (map entries (gram t)))%bool.
Definition all_parts d := fold_right (fun t s => part_poly (known d) t ++ s) nil (parts d).
Definition holds d :=
  let k := whole (k d) in
  (Z.ltb 0 k && forallb nonnegative (parts d) &&
   zero (scale k (spread (p d)) ++ scale (- k) (spread (low d)) ++
         scale (-1) (dot (map spread (cofactors d)) (map spread (zeros d)) ++ all_parts d)))%bool.
Fixpoint where_zero x zeros (P : Prop) : Prop := match zeros with nil => P | r :: zeros => value x r = 0 -> where_zero x zeros P end.
Fixpoint where_known x known (P : Prop) : Prop := match known with nil => P | g :: known => 0 <= value x g -> where_known x known P end.

Fixpoint all (P : poly -> Prop) l := match l with nil => True | p :: l => P p /\ all P l end.
Lemma where_zero_is x zeros (P : Prop) : (all (fun r => value x r = 0) zeros -> P) -> where_zero x zeros P.
Proof. induction zeros; simpl; tauto. Qed.
Lemma where_known_is x known (P : Prop) : (all (fun g => 0 <= value x g) known -> P) -> where_known x known P.
Proof. induction known; simpl; tauto. Qed.
Lemma dot_is x zeros : forall cofactors, all (fun r => value x r = 0) zeros -> at_ x (dot cofactors (map spread zeros)) = 0.
Proof.
  induction zeros as [| r zeros IH]; intros [| c cofactors]; simpl; trivial. intros [H K].
  rewrite app_is, mul_is, <- value_is, IH, H; trivial. ring.
Qed.
Lemma known_is x known : all (fun g => 0 <= value x g) known -> forall i, 0 <= value x (nth i known o).
Proof.
  induction known as [| g known IH]; simpl; intros H i; destruct i; simpl; first [lra | apply IH; tauto].
Qed.
Lemma part_is x known t : all (fun g => 0 <= value x g) known -> nonnegative t = true -> 0 <= at_ x (part_poly known t).
Proof.
  unfold nonnegative, part_poly. intros H D. apply andb_prop in D. destruct D as [L D]. apply Nat.eqb_eq in L.
  assert (F : 0 <= at_ x (tidy (form_poly (map entries (gram t)) (map spread (forms t))))).
  { rewrite tidy_is, form_poly_is. apply semidefinite_is with (1 := D). rewrite !map_length. trivial. }
  revert F. generalize (tidy (form_poly (map entries (gram t)) (map spread (forms t)))).
  induction (of t) as [| i m IH]; simpl; trivial. intros f F. apply IH. rewrite tidy_is, mul_is, <- value_is.
  apply Rmult_le_pos; trivial. apply known_is. trivial.
Qed.
Lemma holds_is d x : holds d = true -> all (fun r => value x r = 0) (zeros d) ->
  all (fun g => 0 <= value x g) (known d) -> exists r, 0 <= r /\ (parts d = nil -> r = 0) /\
    0 < IZR (whole (k d)) /\ IZR (whole (k d)) * (value x (p d) - value x (low d)) = r.
Proof.
  unfold holds, all_parts. intros H Z K. apply andb_prop in H. destruct H as [H E]. apply andb_prop in H.
  destruct H as [H D]. apply Z.ltb_lt, IZR_lt in H. apply zero_is with (x := x) in E.
  rewrite !app_is, !scale_is, app_is, (dot_is x _ _ Z), <- !value_is, opp_IZR in E.
  exists (at_ x (fold_right (fun t s => part_poly (known d) t ++ s) nil (parts d))).
  split; [| split; [intro N; rewrite N; trivial | split; [trivial | lra]]].
  clear E. induction (parts d) as [| t l IH]; simpl in *; [lra |]. apply andb_prop in D. destruct D as [D E].
  rewrite app_is. pose proof (part_is x (known d) t K D). specialize (IH E). lra.
Qed.

(* The rules. *)
Theorem exceeds d : holds d = true ->
  forall x, where_zero x (zeros d) (where_known x (known d) (value x (low d) <= value x (p d))).
Proof.
  intros H x. apply where_zero_is. intro Z. apply where_known_is. intro K.
  destruct (holds_is d x H Z K) as (r & R & _ & P & E). apply Rmult_le_reg_l with (IZR (whole (k d))); lra.
Qed.
Definition level d := (holds d && match known d, parts d, low d with nil, nil, o => true | _, _, _ => false end)%bool.
Theorem vanishes d : level d = true -> forall x, where_zero x (zeros d) (value x (p d) = 0).
Proof.
  unfold level. intros H x. apply andb_prop in H. destruct H as [H N]. apply where_zero_is. intro Z.
  destruct (known d) eqn:K; try discriminate. destruct (parts d) eqn:T; try discriminate. destruct (low d) eqn:L; try discriminate.
  destruct (holds_is d x H Z) as (r & _ & R & P & E); [rewrite K; exact I |]. rewrite (R T), L in E. simpl in E.
  apply Rmult_eq_reg_l with (IZR (whole (k d))); lra.
Qed.
Theorem smaller a b c d : (Z.ltb 0 (whole b) && Z.ltb 0 (whole d) && Z.ltb (whole a * whole d) (whole c * whole b))%bool = true ->
  num a / num b < num c / num d.
Proof.
  intro H. apply andb_prop in H. destruct H as [H L]. apply andb_prop in H. destruct H as [H K].
  apply Z.ltb_lt, IZR_lt in H, K, L. rewrite !mult_IZR in L. rewrite !num_is.
  apply Rmult_lt_reg_r with (IZR (whole b)); trivial. apply Rmult_lt_reg_r with (IZR (whole d)); trivial.
  replace (IZR (whole a) / IZR (whole b) * IZR (whole b) * IZR (whole d)) with (IZR (whole a) * IZR (whole d)) by (field; lra).
  replace (IZR (whole c) / IZR (whole d) * IZR (whole b) * IZR (whole d)) with (IZR (whole c) * IZR (whole b)) by (field; lra). trivial.
Qed.
