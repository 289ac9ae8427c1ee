(* Rules: what evidence shows of polynomials with whole coefficients. Their proofs stand here, so none is to be believed. *)
From Coq Require Import Reals ZArith List Lra Lia Bool QArith_base.
Import ListNotations.
Open Scope R_scope.

(* A polynomial: terms, each of a coefficient and of the places of its factors among the variables x. *)
Definition poly := list (Z * list nat).
Fixpoint product x (c : R) m := match m with nil => c | i :: m => product x (c * nth i x 0) m end.
Definition term x (t : Z * list nat) := product x (IZR (fst t)) (snd t).
Definition value x (p : poly) := match p with nil => 0 | t :: p => fold_left (fun s t => s + term x t) p (term x t) end.

(* The same, added and multiplied from the right. *)
Fixpoint factors x m := match m with nil => 1 | i :: m => nth i x 0 * factors x m end.
Fixpoint at_ x (p : poly) := match p with nil => 0 | (c, m) :: p => IZR c * factors x m + at_ x p end.
Lemma product_is x m : forall c, product x c m = c * factors x m.
Proof. induction m; intros; simpl; [ring | rewrite IHm; ring]. Qed.
Lemma value_is x p : value x p = at_ x p.
Proof.
  assert (H : forall p s, fold_left (fun s t => s + term x t) p s = s + at_ x p).
  { induction p0 as [| [c m] p0 IH]; intros; simpl; [ring |].
    rewrite IH. unfold term; simpl. rewrite product_is. ring. }
  destruct p as [| [c m] p]; simpl; trivial. rewrite H. unfold term; simpl. rewrite product_is. ring.
Qed.

(* Sums and products, with sorted factors and sorted terms, so that equal terms meet. *)
Fixpoint insert (i : nat) m := match m with nil => [i] | j :: n => if Nat.leb i j then i :: m else j :: insert i n end.
Definition together m n := fold_right insert n m.
Fixpoint order (m n : list nat) := match m, n with
  | nil, nil => Eq | nil, _ => Lt | _, nil => Gt
  | i :: m, j :: n => match Nat.compare i j with Eq => order m n | o => o end end.
Fixpoint put (c : Z) m (p : poly) : poly := match p with
  | nil => [(c, m)]
  | (d, n) :: q => match order m n with Eq => ((c + d)%Z, n) :: q | Lt => (c, m) :: p | Gt => (d, n) :: put c m q end end.
Definition add (p q : poly) := fold_right (fun t s => put (fst t) (snd t) s) q p.
Definition times_term c m (p : poly) : poly := map (fun t => ((c * fst t)%Z, together m (snd t))) p.
Fixpoint mul (p q : poly) : poly := match p with nil => nil | (c, m) :: p => add (times_term c m q) (mul p q) end.
Definition scale c (p : poly) : poly := times_term c nil p.
Fixpoint dot (p q : list poly) := match p, q with a :: p, b :: q => add (mul a b) (dot p q) | _, _ => nil end.
Definition zero (p : poly) := forallb (fun t => Z.eqb (fst t) 0) p.

Lemma insert_is x i m : factors x (insert i m) = nth i x 0 * factors x m.
Proof. induction m as [| j m IH]; simpl; trivial. destruct (Nat.leb i j); simpl; trivial. rewrite IH. ring. Qed.
Lemma together_is x m n : factors x (together m n) = factors x m * factors x n.
Proof. induction m; simpl; [ring |]. rewrite insert_is, IHm. ring. Qed.
Lemma order_is m : forall n, order m n = Eq -> m = n.
Proof.
  induction m as [| i m IH]; destruct n as [| j n]; simpl; try discriminate; trivial.
  destruct (Nat.compare_spec i j); try discriminate. intro. f_equal; auto.
Qed.
Lemma put_is x c m p : at_ x (put c m p) = IZR c * factors x m + at_ x p.
Proof.
  induction p as [| [d n] p IH]; simpl; trivial. destruct (order m n) eqn:E; simpl; trivial.
  - apply order_is in E. subst. rewrite plus_IZR. ring.
  - rewrite IH. ring.
Qed.
Lemma add_is x p q : at_ x (add p q) = at_ x p + at_ x q.
Proof. unfold add. induction p as [| [c m] p IH]; simpl; [ring |]. rewrite put_is, IH. ring. Qed.
Lemma times_term_is x c m p : at_ x (times_term c m p) = IZR c * factors x m * at_ x p.
Proof.
  unfold times_term. induction p as [| [d n] p IH]; simpl; [ring |]. rewrite together_is, mult_IZR, IH. ring.
Qed.
Lemma mul_is x p q : at_ x (mul p q) = at_ x p * at_ x q.
Proof. induction p as [| [c m] p IH]; simpl; [ring |]. rewrite add_is, times_term_is, IH. ring. Qed.
Lemma scale_is x c p : at_ x (scale c p) = IZR c * at_ x p.
Proof. unfold scale. rewrite times_term_is. simpl. ring. Qed.
Lemma zero_is x p : zero p = true -> at_ x p = 0.
Proof.
  induction p as [| [c m] p IH]; simpl; trivial. intro H. apply andb_prop in H. destruct H as [H K].
  apply Z.eqb_eq in H. subst. rewrite IH; trivial. ring.
Qed.

(* A symmetric matrix, as its rows from the diagonal on, is nowhere negative: elimination without fractions. *)
Fixpoint along (g : list Z) (z : list R) := match g, z with a :: g, r :: z => IZR a * r + along g z | _, _ => 0 end.
Fixpoint form (G : list (list Z)) (z : list R) := match G, z with
  | (a :: g) :: G, r :: z => IZR a * r * r + 2 * r * along g z + form G z | _, _ => 0 end.
Fixpoint row (b c a : Z) r g := match r, g with
  | x :: r, y :: g => ((a * x - b * y) / c)%Z :: row b c a r g | _, _ => nil end.
Fixpoint rest (c a : Z) g (G : list (list Z)) := match g, G with
  | b :: h, r :: G => row b c a r g :: rest c a h G | _, _ => nil end.
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

(* Sooner: G less multiples of squares (u.z)^2 of short numbers u leaves a matrix whose diagonal outweighs its rows. *)
Fixpoint outer u := match u with nil => nil | a :: v => map (Z.mul a) u :: outer v end.
Definition row_less m (r s : list Z) := map (fun t => (fst t - m * snd t)%Z) (combine r s).
Definition remainders m (G H : list (list Z)) := map (fun t => row_less m (fst t) (snd t)) (combine G H).
Fixpoint alike (G H : list (list Z)) := match G, H with
  | r :: G, s :: H => (Nat.eqb (length r) (length s) && alike G H)%bool | nil, nil => true | _, _ => false end.
Fixpoint outweighs k m (R : list (list Z)) := match R with
  | nil => true | nil :: _ => false
  | (a :: g) :: R => (Z.leb (m * (k + Z.of_nat (length g)))%Z a && forallb (fun y => Z.leb (Z.abs y) m) g && outweighs (k + 1)%Z m R)%bool end.
Fixpoint positive m e U (G : list (list Z)) := match U with
  | nil => (Z.leb 0 e && outweighs 0 e G)%bool
  | u :: U => let H := outer u in (alike G H && positive m e U (remainders m G H))%bool end.
Definition semidefinite m e U (G : list (list Z)) :=
  match U with nil => nowhere_negative (length G) 1 G | _ => (Z.leb 0 m && positive m e U G)%bool end.

Lemma row_less_is m r : forall s z, length r = length s -> along (row_less m r s) z = along r z - IZR m * along s z.
Proof.
  induction r as [| a r IH]; destruct s as [| b s]; simpl; try discriminate; intros z E; [destruct z; ring |].
  destruct z as [| u z]; [ring |]. injection E; intro. unfold row_less in IH. rewrite IH; trivial.
  rewrite minus_IZR, mult_IZR. ring.
Qed.
Lemma remainders_is m G : forall H z, alike G H = true -> form G z = IZR m * form H z + form (remainders m G H) z.
Proof.
  induction G as [| [| a r] G IH]; destruct H as [| [| b s] H]; simpl; try discriminate; intros z E; try ring.
  apply andb_prop in E. destruct E as [E K]. apply Nat.eqb_eq in E. destruct z as [| u z]; [ring |].
  unfold remainders in IH. rewrite (IH H z K). pose proof (row_less_is m r s z E) as L. unfold row_less in L. rewrite L.
  rewrite minus_IZR, mult_IZR. ring.
Qed.
Definition squares z := fold_right (fun u s => u * u + s) 0 z.
Lemma squares_is z : 0 <= squares z.
Proof. induction z; simpl; [lra | nra]. Qed.
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
Lemma outweighs_is m R : forall k z, 0 <= IZR m -> outweighs k m R = true -> (length z <= length R)%nat ->
  IZR k * IZR m * squares z <= form R z.
Proof.
  induction R as [| [| a g] R IH]; simpl outweighs; try discriminate; intros k z M H L.
  - destruct z; simpl in *; [lra | lia].
  - apply andb_prop in H. destruct H as [H K]. apply andb_prop in H. destruct H as [H J]. destruct z as [| u z]; [simpl; lra |].
    apply Z.leb_le, IZR_le in H. rewrite mult_IZR, plus_IZR, <- INR_IZR_INZ in H.
    pose proof (along_bounded m g u z M J). specialize (IH (k + 1)%Z z M K). rewrite plus_IZR in IH.
    simpl in *. assert (L' : (length z <= length R)%nat) by lia. specialize (IH L').
    pose proof (Rle_0_sqr u). unfold Rsqr in *. nra.
Qed.
Lemma scaled_is a g : forall z, along (map (Z.mul a) g) z = IZR a * along g z.
Proof. induction g; destruct z; simpl; try ring. rewrite IHg, mult_IZR. ring. Qed.
Lemma outer_is u : forall z, form (outer u) z = along u z * along u z.
Proof. induction u; destruct z; simpl; try ring. rewrite scaled_is, IHu, mult_IZR. ring. Qed.
Lemma alike_is G : forall H, alike G H = true -> length H = length G.
Proof. induction G; destruct H; simpl; try discriminate; trivial. intro E. apply andb_prop in E. f_equal. apply IHG, E. Qed.
Lemma positive_is m e U : forall G z, 0 <= IZR m -> positive m e U G = true -> length z = length G -> 0 <= form G z.
Proof.
  induction U as [| u U IH]; simpl; intros G z M H L; apply andb_prop in H; destruct H as [H K].
  - apply Z.leb_le, IZR_le in H. pose proof (outweighs_is e G 0 z H K). rewrite L in *. specialize (H0 (le_n _)). lra.
  - rewrite (remainders_is m G (outer u) z H), outer_is. pose proof (Rle_0_sqr (along u z)). unfold Rsqr in *.
    assert (0 <= form (remainders m G (outer u)) z).
    { apply IH; trivial. unfold remainders. rewrite map_length, combine_length, (alike_is _ _ H). lia. }
    pose proof (Rmult_le_pos _ _ M H0). lra.
Qed.
Lemma semidefinite_is m e U G z : semidefinite m e U G = true -> length z = length G -> 0 <= form G z.
Proof.
  unfold semidefinite. destruct U as [| u U]; intros H L.
  - apply nowhere_negative_is with (1 := H). lra.
  - apply andb_prop in H. destruct H as [H K]. apply Z.leb_le, IZR_le in H. apply positive_is with (2 := K); trivial.
Qed.

(* z'Gz as a polynomial. *)
Fixpoint along_poly g z := match g, z with a :: g, p :: z => add (scale a p) (along_poly g z) | _, _ => nil end.
Fixpoint form_poly G z := match G, z with
  | (a :: g) :: G, p :: z => add (mul p (add (scale a p) (scale 2 (along_poly g z)))) (form_poly G z) | _, _ => nil end.
Lemma along_poly_is x g : forall z, at_ x (along_poly g z) = along g (map (at_ x) z).
Proof. induction g; destruct z; simpl; trivial. rewrite add_is, scale_is, IHg. trivial. Qed.
Lemma form_poly_is x G : forall z, at_ x (form_poly G z) = form G (map (at_ x) z).
Proof.
  induction G as [| [| a g] G IH]; destruct z; simpl; trivial.
  rewrite add_is, mul_is, add_is, !scale_is, along_poly_is, IH. ring.
Qed.

(* k (p - low) = cofactors . zeros + the sum of parts: products of what is not negative, each times z'Gz. *)
Record part := { known : list poly; forms : list poly; gram : list (list Z); size : Z; error : Z; taken : list (list Z) }.
Definition part_poly t := fold_right mul (form_poly (gram t) (forms t)) (known t).
Definition definite t :=
  (Nat.eqb (length (forms t)) (length (gram t)) && semidefinite (size t) (error t) (taken t) (gram t))%bool.
Definition less p q := add p (scale (-1) q).
Definition holds k p low cofactors zeros (parts : list part) :=
  (Z.ltb 0 k && forallb definite parts &&
   zero (less (scale k (less p low)) (add (dot cofactors zeros) (fold_right add nil (map part_poly parts)))))%bool.
Definition all (P : poly -> Prop) l := fold_right (fun p Q => P p /\ Q) True l.

Lemma dot_is x zeros : forall cofactors, all (fun p => value x p = 0) zeros -> at_ x (dot cofactors zeros) = 0.
Proof.
  induction zeros as [| p zeros IH]; destruct cofactors; simpl; trivial. intros [H K].
  rewrite add_is, mul_is, <- value_is, IH, value_is; trivial. rewrite <- (value_is x p), H. ring.
Qed.

Lemma part_is x t : all (fun g => 0 <= value x g) (known t) -> definite t = true -> 0 <= at_ x (part_poly t).
Proof.
  unfold definite, part_poly. intros H D. apply andb_prop in D. destruct D as [L D]. apply Nat.eqb_eq in L.
  induction (known t) as [| g f IH]; simpl in *.
  - rewrite form_poly_is. apply semidefinite_is with (1 := D). rewrite map_length. trivial.
  - rewrite mul_is, <- value_is. apply Rmult_le_pos; tauto.
Qed.
Definition given x t := all (fun g => 0 <= value x g) (known t).
Lemma parts_are x parts : fold_right (fun t Q => given x t /\ Q) True parts -> forallb definite parts = true ->
  0 <= at_ x (fold_right add nil (map part_poly parts)).
Proof.
  induction parts as [| t parts IH]; simpl; [lra |]. intros [H K] D. apply andb_prop in D. destruct D as [D E].
  rewrite add_is. pose proof (part_is x t H D). specialize (IH K E). lra.
Qed.

Lemma less_is x p q : at_ x (less p q) = at_ x p - at_ x q.
Proof. unfold less. rewrite add_is, scale_is. lra. Qed.

(* The two rules. *)
Theorem exceeds x k p low cofactors zeros parts : holds k p low cofactors zeros parts = true ->
  all (fun r => value x r = 0) zeros -> fold_right (fun t Q => given x t /\ Q) True parts -> value x low <= value x p.
Proof.
  unfold holds. intros H Z K. apply andb_prop in H. destruct H as [H E]. apply andb_prop in H. destruct H as [H D].
  apply Z.ltb_lt, IZR_lt in H. apply zero_is with (x := x) in E.
  rewrite less_is, scale_is, less_is, add_is, (dot_is x zeros cofactors Z) in E.
  pose proof (parts_are x parts K D). rewrite !value_is. apply Rmult_le_reg_l with (IZR k); lra.
Qed.
Theorem vanishes x k p cofactors zeros : (Z.ltb 0 k && zero (less (scale k p) (dot cofactors zeros)))%bool = true ->
  all (fun r => value x r = 0) zeros -> value x p = 0.
Proof.
  intros H Z. apply andb_prop in H. destruct H as [H E]. apply Z.ltb_lt, IZR_lt in H. apply zero_is with (x := x) in E.
  rewrite less_is, scale_is, (dot_is x zeros cofactors Z) in E. rewrite value_is. apply Rmult_eq_reg_l with (IZR k); lra.
Qed.
